use super::{FilterOptions, low_pass};
use crate::error::Result;
use lightcast_core::light::ReferencedList;
use lightcast_core::temporal::{LightFilter, Taps};

/// A [`LightFilter`] whose taps are designed for the frame rate of its lists, and designed again when it
/// changes.
#[derive(Clone, Debug)]
pub struct RateFilter {
    options: FilterOptions,
    filter: LightFilter,
    /// The rate of the taps, as bits, so that NaN (an unknown rate) equals itself.
    rate_bits: Option<u64>,
}

impl RateFilter {
    /// A filter with an empty history.
    ///
    /// # Errors
    /// Kind `Usage`, naming the key, for values that [`FilterOptions::check`] refuses.
    pub fn new(options: &FilterOptions) -> Result<Self> {
        options.check()?;
        let filter = LightFilter::new(Taps::identity(), options.directions);
        Ok(Self { options: *options, filter, rate_bits: None })
    }

    /// Takes the next list of the sequence and writes the filtered one, as [`LightFilter::step`].
    ///
    /// # Errors
    /// Those of [`low_pass`], when the first list or a new frame rate requires a filter that cannot be
    /// designed; the next list is then treated as the first.
    pub fn step(&mut self, input: &ReferencedList, filtered: &mut ReferencedList) -> Result<()> {
        let rate_bits = Some(input.list.stamp.frame_rate_hz.to_bits());
        if self.rate_bits != rate_bits {
            self.rate_bits = None;
            self.filter.set_taps(low_pass(input.list.stamp.frame_rate_hz, &self.options)?);
            self.rate_bits = rate_bits;
        }
        self.filter.step(input, filtered);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;
    use lightcast_core::image::Stamp;
    use lightcast_core::light::Light;
    use lightcast_core::light::LightList;

    fn lamp(sequence: u64, frame_rate_hz: f64, irradiance: f32) -> ReferencedList {
        let light = Light { id: 0, direction: [0.0, 1.0, 0.0], irradiance: [irradiance; 3], spread_rad: 0.0 };
        let stamp = Stamp { sequence, frame_rate_hz, ..Stamp::default() };
        let list = LightList { stamp, lights: vec![light], ..LightList::default() };
        ReferencedList { list, ..ReferencedList::default() }
    }

    #[test]
    fn the_delay_is_that_of_the_lists_rate_and_a_new_rate_is_a_start() {
        let mut filter = RateFilter::new(&FilterOptions::default()).unwrap();
        let mut filtered = ReferencedList::default();
        for (sequence, rate, delay) in
            [(0, 25.0, 4), (1, 25.0, 4), (2, 60.0, 10), (3, f64::NAN, 0), (4, f64::NAN, 0)]
        {
            let irradiance = (sequence + 1) as f32;
            filter.step(&lamp(sequence, rate, irradiance), &mut filtered).unwrap();
            assert_eq!(filtered.list.filter_delay_frames, delay, "{rate} Hz");
            let is_start = filtered.list.lights[0].irradiance == [irradiance; 3];
            assert_eq!(is_start, sequence != 1, "list {sequence}");
        }
    }

    #[test]
    fn a_frame_rate_too_high_for_a_filter_is_an_error_and_the_next_list_a_start() {
        let mut filter = RateFilter::new(&FilterOptions::default()).unwrap();
        let mut filtered = ReferencedList::default();
        filter.step(&lamp(0, 25.0, 1.0), &mut filtered).unwrap();
        assert_eq!(filter.step(&lamp(1, 5000.0, 1.0), &mut filtered).unwrap_err().kind(), Kind::Usage);
        filter.step(&lamp(2, 25.0, 3.0), &mut filtered).unwrap();
        assert_eq!(filtered.list.lights[0].irradiance, [3.0; 3]);
        let wrong = FilterOptions { stop_hz: 1.0, ..FilterOptions::default() };
        assert!(RateFilter::new(&wrong).unwrap_err().to_string().contains("stop_hz"));
    }
}
