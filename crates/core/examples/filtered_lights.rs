//! Maps to lights that do not flicker, frame by frame: `cargo run --example filtered_lights`.

use lightcast_core::error::Result;
use lightcast_core::image::{PolarMap, PolarShape, Stamp};
use lightcast_core::light::{Extractor, Options, ReferencedList};
use lightcast_core::temporal::{Directions, LightFilter, Taps};

/// A low-pass filter to 7 Hz at 25 frames a second with a delay of 4 frames (Havran et al. 2005), before it
/// is divided by its sum.
const PUBLISHED: [f64; 9] =
    [0.06216, 0.01296, -0.13816, 0.28315, 0.65223, 0.28315, -0.13816, 0.01296, 0.06216];

fn main() -> Result<()> {
    let sum: f64 = PUBLISHED.iter().sum();
    let taps = Taps::new(PUBLISHED.map(|tap| tap / sum).to_vec())?;
    let shape = PolarShape::hemisphere(360, 90);
    let mut extractor = Extractor::new(shape, &Options { count: 32, ..Options::default() })?;
    let mut filter = LightFilter::new(taps, Directions::ByPower);
    let (mut list, mut filtered) = (ReferencedList::default(), ReferencedList::default());
    for t in 0..20 {
        // A lamp flickers in every other frame. After the first frames only the picture allocates memory
        // here.
        let lamp = if t % 2 == 0 { 100.0 } else { 300.0 };
        let is_lamp = |row, column| (40..44).contains(&row) && (200..204).contains(&column);
        let mut map =
            PolarMap::from_fn(shape, |row, column| [if is_lamp(row, column) { lamp } else { 1.0 }; 3]);
        map.stamp = Stamp {
            sequence: t,
            capture_time_ns: 40_000_000 * t as i64,
            lost_before: 0,
            frame_rate_hz: 25.0,
        };
        extractor.step(&map, &mut list);
        filter.step(&list, &mut filtered);
        println!("frame {t:2}: power {:.3} becomes {:.3}", list.list.power[1], filtered.list.power[1]);
    }
    Ok(())
}
