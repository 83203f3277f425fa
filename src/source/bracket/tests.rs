use super::*;
use crate::source::BadBuffer;
use lightcast_core::camera::ResponseModel;
use lightcast_core::image::Pixels;

/// A sensor whose exposure follows its setting after `latency` frames; scene radiances by pixel, 8-bit linear
/// codes.
struct Scripted {
    scene: Vec<f64>,
    unit_s: f64,
    latency: u32,
    /// The first frame of every setting and its value.
    settings: Vec<(u32, i64)>,
    frames: VecDeque<Event>,
    /// The frame that is being exposed.
    now: u32,
}

#[derive(Clone, Copy)]
enum Event {
    Frame(u32),
    Bad(u32),
    /// A frame that is taken out of the queue a number of frames late.
    Late(u32, u32),
}

impl Scripted {
    fn value(&self, frame: u32) -> i64 {
        self.settings.iter().rfind(|(from, _)| *from <= frame).map_or(777, |(_, value)| *value)
    }
}

/// Frames come every 10 ns, and the bus takes 3 ns.
fn mark(sequence: u32, late: u32) -> Mark {
    Mark { sequence, time_ns: i64::from(sequence) * 10, age_ns: i64::from(late) * 10 + 3 }
}

const RATE_HZ: f64 = 1e8;

impl LiveCamera for Scripted {
    fn start(&mut self) -> Result<()> {
        self.settings.clear();
        Ok(())
    }

    fn capture(&mut self, _: Duration, frame: &mut Frame) -> Result<Captured> {
        let event = self.frames.pop_front().unwrap();
        let (sequence, late) = match event {
            Event::Frame(sequence) | Event::Bad(sequence) => (sequence, 0),
            Event::Late(sequence, late) => (sequence, late),
        };
        self.now = sequence + late;
        if let Event::Bad(sequence) = event {
            return Ok(Captured::Bad(mark(sequence, 0), BadBuffer::Faulty));
        }
        let exposure_s = self.value(sequence) as f64 * self.unit_s;
        let codes =
            self.scene.iter().map(|radiance| (radiance * exposure_s * 100.0).round().min(255.0) as u16);
        let (width, height) = (self.scene.len(), 1);
        *frame = Frame { width, height, pixels: Pixels::Codes(codes.collect()), ..Frame::default() };
        Ok(Captured::Frame(mark(sequence, late)))
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

/// Marks of the rounds (round, time), faulty frames, and rounds that were reported incomplete; every merged
/// frame must equal the scene.
fn play(frames: &[Event], latency: u32) -> (Vec<(u32, i64)>, usize, Vec<u32>) {
    let camera = Scripted {
        scene: SCENE.to_vec(),
        unit_s: 1e-4,
        latency,
        settings: Vec::new(),
        frames: frames.iter().copied().collect(),
        now: 0,
    };
    let metrics = Metrics::new("source");
    let mut bracket = Bracket::new(camera, RATE_HZ, &options(latency), &response(), &metrics).unwrap();
    bracket.start().unwrap();
    let (mut rounds, mut bad, mut incomplete) = (Vec::new(), 0, Vec::new());
    let mut frame = Frame::default();
    for _ in frames {
        match bracket.capture(Duration::ZERO, &mut frame).unwrap() {
            Captured::Part => {}
            Captured::Nothing => panic!("a frame has come"),
            Captured::Bad(mark, BadBuffer::Incomplete) => incomplete.push(mark.sequence),
            Captured::Bad(..) => bad += 1,
            Captured::Frame(mark) => {
                rounds.push((mark.sequence, mark.time_ns));
                let Pixels::Radiance(values) = &frame.pixels else { panic!("codes") };
                // Tolerances are half a code of 100, of 30 and of 90, the codes in the best exposure of each
                // pixel.
                for (value, (scene, tolerance)) in
                    values.iter().zip(SCENE.into_iter().zip([0.06, 0.02, 0.01]))
                {
                    assert!((f64::from(*value) / scene - 1.0).abs() < tolerance, "{value} {scene}");
                }
                // Brighter than the shortest exposure can measure: 255 codes at 1 ms.
                assert!((values[3] - 2550.0).abs() < 0.1, "{}", values[3]);
                assert_eq!(values[3], frame.saturation);
            }
        }
    }
    (rounds, bad, incomplete)
}

fn numbers(rounds: &[(u32, i64)]) -> Vec<u32> {
    rounds.iter().map(|round| round.0).collect()
}

fn run(range: std::ops::Range<u32>) -> Vec<Event> {
    range.map(Event::Frame).collect()
}

#[test]
fn every_round_becomes_the_scene_whatever_the_latency() {
    for latency in 1..=5 {
        let (rounds, bad, incomplete) = play(&run(0..15), latency);
        // The first round whose exposures had all been set.
        let first = latency.div_ceil(3);
        let expected: Vec<(u32, i64)> = (first..5).map(|round| (round, i64::from(30 * round + 10))).collect();
        assert_eq!((rounds, bad, incomplete), (expected, 0, (0..first).collect()), "latency {latency}");
    }
}

#[test]
fn a_missing_frame_costs_its_round_and_those_whose_exposures_it_should_have_set() {
    let frames = [run(0..7), run(8..21)].concat();
    let (rounds, _, incomplete) = play(&frames, 2);
    // Frame 7 is missing in round 2, and frame 9 would have been set at its arrival: round 3 begins with the
    // wrong exposure.
    assert_eq!((numbers(&rounds), incomplete), (vec![1, 4, 5, 6], vec![0, 2, 3]));
}

#[test]
fn bad_frames_are_all_told_and_cost_their_round_only() {
    let frames =
        [run(0..7), vec![Event::Bad(7), Event::Bad(8)], run(9..15), vec![Event::Bad(15)], run(16..21)]
            .concat();
    let (rounds, bad, incomplete) = play(&frames, 1);
    assert_eq!((numbers(&rounds), bad), (vec![1, 3, 4, 6], 3));
    assert_eq!(incomplete, [0, 5], "round 2 ends with a bad frame, which is told as such");
}

#[test]
fn frames_that_waited_in_the_queue_do_not_have_exposures_that_were_set_too_late_for_them() {
    // The reader stalls for three frames after frame 6, and takes what has queued up in a burst.
    let late = [Event::Late(7, 3), Event::Late(8, 2), Event::Late(9, 1)];
    let frames = [run(0..7), late.to_vec(), run(10..24)].concat();
    for latency in 1..=4 {
        // `play` checks that the merged frames equal the scene; this checks that complete rounds resume soon.
        let (rounds, _, _) = play(&frames, latency);
        assert_eq!(numbers(&rounds).last(), Some(&7), "latency {latency}");
        assert!(rounds.len() >= 4, "latency {latency}: {rounds:?}");
    }
}

#[test]
fn a_driver_that_does_not_count_gives_rounds_too() {
    let camera = Scripted {
        scene: SCENE.to_vec(),
        unit_s: 1e-4,
        latency: 1,
        settings: Vec::new(),
        frames: VecDeque::new(),
        now: 0,
    };
    let metrics = Metrics::new("source");
    let mut bracket = Bracket::new(camera, RATE_HZ, &options(1), &response(), &metrics).unwrap();
    let rounds: Vec<Step> = (0..9).map(|_| bracket.arrive(mark(0, 0)).unwrap()).collect();
    assert_eq!(rounds.iter().filter(|step| step.is_last && step.exposure.is_some()).count(), 2);
    assert!(bracket.plan.settings.len() <= 3, "{:?}", bracket.plan);
}

#[test]
fn options_that_make_no_rounds_are_refused() {
    for (options, expected) in [
        (options(0), "latency_frames = 0"),
        (options(17), "must be 1 to 16"),
        (BracketOptions { values: vec![5], ..options(1) }, "values: 1 exposures cannot be merged"),
        (BracketOptions { values: vec![5, 5], ..options(1) }, "values[1] = 5: is there twice"),
        (BracketOptions { values: vec![5, 0], ..options(1) }, "values[1] = 0: must be a positive number"),
        (BracketOptions { unit_s: f64::NAN, ..options(1) }, "unit_s = NaN: must be a positive number"),
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
        let error = Bracket::new(camera, RATE_HZ, &options, &response(), &metrics).err().unwrap().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
