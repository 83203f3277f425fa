use super::*;
use crate::camera::ResponseModel;
use crate::image::Pixels;
use crate::source::BadBuffer;

/// A sensor whose exposure follows what it is told after `latency` frames; scene radiances by pixel, 8-bit linear codes.
struct Scripted {
    scene: Vec<f64>,
    unit_s: f64,
    latency: u32,
    /// From which frame on which value holds.
    settings: Vec<(u32, i64)>,
    frames: VecDeque<Event>,
    now: u32,
}

#[derive(Clone, Copy)]
enum Event {
    Frame(u32),
    Bad(u32),
}

impl Scripted {
    fn value(&self, frame: u32) -> i64 {
        self.settings.iter().rfind(|(from, _)| *from <= frame).map_or(777, |(_, value)| *value)
    }
}

fn mark(sequence: u32) -> Mark {
    Mark { sequence, time_ns: i64::from(sequence) * 10 }
}

impl Camera for Scripted {
    fn start(&mut self) -> Result<()> {
        self.settings.clear();
        Ok(())
    }

    fn capture(&mut self, _: Duration, frame: &mut Frame) -> Result<Captured> {
        let event = self.frames.pop_front().unwrap();
        let (Event::Frame(sequence) | Event::Bad(sequence)) = event;
        self.now = sequence;
        if let Event::Bad(sequence) = event {
            return Ok(Captured::Bad(mark(sequence), BadBuffer::Faulty));
        }
        let exposure_s = self.value(sequence) as f64 * self.unit_s;
        let codes =
            self.scene.iter().map(|radiance| (radiance * exposure_s * 100.0).round().min(255.0) as u16);
        let (width, height) = (self.scene.len(), 1);
        *frame = Frame { width, height, pixels: Pixels::Codes(codes.collect()), ..Frame::default() };
        Ok(Captured::Frame(mark(sequence)))
    }

    fn stop(&mut self) {}
}

impl ExposureControl for Scripted {
    fn set_exposure(&mut self, value: i64) -> Result<()> {
        self.settings.push((self.now + self.latency, value));
        Ok(())
    }
}

const SCENE: [f64; 4] = [1.0, 30.0, 900.0, 1e6];
const VALUES: [i64; 3] = [1000, 100, 10];

fn options(latency_frames: u32) -> BracketOptions {
    let values = VALUES.to_vec();
    BracketOptions { control: "exposure".to_owned(), values, unit_s: 1e-4, latency_frames }
}

fn response() -> Response {
    Response::new(ResponseModel::Linear { black_level: 0, white_level: 255, gain: 0.01 }).unwrap()
}

/// Marks of the rounds (round, time), bad frames, and incomplete rounds; every merged frame must be the scene.
fn play(frames: &[Event], latency: u32) -> (Vec<(u32, i64)>, usize, u64) {
    let camera = Scripted {
        scene: SCENE.to_vec(),
        unit_s: 1e-4,
        latency,
        settings: Vec::new(),
        frames: frames.iter().copied().collect(),
        now: 0,
    };
    let metrics = Metrics::new("source");
    let mut bracket = Bracket::new(camera, &options(latency), &response(), &metrics).unwrap();
    bracket.start().unwrap();
    let (mut rounds, mut bad) = (Vec::new(), 0);
    let mut frame = Frame::default();
    for _ in frames {
        match bracket.capture(Duration::ZERO, &mut frame).unwrap() {
            Captured::Nothing => {}
            Captured::Bad(..) => bad += 1,
            Captured::Frame(mark) => {
                rounds.push((mark.sequence, mark.time_ns));
                let Pixels::Radiance(values) = &frame.pixels else { panic!("codes") };
                // Half a code of 100, of 30 and of 90: the best exposure of each decides.
                for (value, (scene, tolerance)) in
                    values.iter().zip(SCENE.into_iter().zip([0.06, 0.02, 0.01]))
                {
                    assert!((f64::from(*value) / scene - 1.0).abs() < tolerance, "{value} {scene}");
                }
                // Brighter than the shortest exposure can tell: 255 codes at 1 ms.
                assert!((values[3] - 2550.0).abs() < 0.1, "{}", values[3]);
            }
        }
    }
    let counters = metrics.counters();
    assert_eq!(counters[0].1, rounds.len() as u64, "one saturated pixel in each");
    (rounds, bad, counters[3].1)
}

fn run(range: std::ops::Range<u32>) -> Vec<Event> {
    range.map(Event::Frame).collect()
}

#[test]
fn every_round_becomes_the_scene_whatever_the_latency() {
    for latency in 1..=5 {
        let (rounds, bad, incomplete) = play(&run(0..15), latency);
        // The first round whose exposures were all set.
        let first = latency.div_ceil(3);
        let expected: Vec<(u32, i64)> = (first..5).map(|round| (round, i64::from(30 * round + 10))).collect();
        assert_eq!((rounds, bad, incomplete), (expected, 0, 0), "latency {latency}");
    }
}

#[test]
fn a_missing_frame_costs_its_round_and_those_whose_exposures_it_should_have_set() {
    let frames = [run(0..7), run(8..21)].concat();
    let (rounds, _, incomplete) = play(&frames, 2);
    // Frame 7 is missing in round 2, and frame 9 was to be set at its arrival: round 3 begins wrongly.
    let rounds: Vec<u32> = rounds.iter().map(|round| round.0).collect();
    assert_eq!((rounds, incomplete), (vec![1, 4, 5, 6], 1));
}

#[test]
fn bad_frames_stand_for_their_round_once() {
    let frames = [run(0..7), vec![Event::Bad(7), Event::Bad(8)], run(9..21)].concat();
    let (rounds, bad, _) = play(&frames, 1);
    let rounds: Vec<u32> = rounds.iter().map(|round| round.0).collect();
    assert_eq!((bad, &rounds[..2], rounds.last()), (1, &[1, 4][..], Some(&6)));
}

#[test]
fn options_that_make_no_rounds_are_refused() {
    for (options, expected) in [
        (options(0), "latency_frames = 0"),
        (options(17), "must be 1 to 16"),
        (BracketOptions { values: vec![5], ..options(1) }, "1 exposures cannot be merged"),
        (BracketOptions { values: vec![5, 5], ..options(1) }, "is there twice"),
        (BracketOptions { values: vec![5, 0], ..options(1) }, "must be a positive number"),
        (BracketOptions { unit_s: f64::NAN, ..options(1) }, "must be a positive number"),
    ] {
        let camera = Scripted {
            scene: Vec::new(),
            unit_s: 1.0,
            latency: 1,
            settings: Vec::new(),
            frames: VecDeque::new(),
            now: 0,
        };
        let metrics = Metrics::new("source");
        let error = Bracket::new(camera, &options, &response(), &metrics).err().unwrap().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
