//! In the steady state, a frame causes no allocations in calibrate, light and filter. The stages, links,
//! fan-outs and loop are those of the program, run under a counting allocator.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use lightcast::design::{FilterOptions, RateFilter};
use lightcast::error::Result;
use lightcast::rt::fan_out::FanOut;
use lightcast::rt::link::{bounded, lossy};
use lightcast::rt::stage::{Flow, Nowhere, Stage, Tick, Ticks, run};
use lightcast::rt::{Clock, Counter, Metrics, Shutdown};
use lightcast::stage::{Calibrate, Filter, Light};
use lightcast_core::camera::{
    ExposureMerge, FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response, ResponseModel,
    SensorNoise,
};
use lightcast_core::image::{Bayer, Frame, Pixels, PolarMap, PolarShape, Stamp};
use lightcast_core::light::{Extractor, LightList, Options, ReferencedList, Sampler};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Allocations of this thread, if they are being counted.
    static COUNT: Cell<Option<u64>> = const { Cell::new(None) };
}

struct Counting;

fn count_one() {
    // A thread that is ending has no thread-local values any more; its allocations then are not those of the
    // loop.
    let _ = COUNT.try_with(|count| count.set(count.get().map(|count| count + 1)));
}

#[expect(unsafe_code, reason = "an allocator cannot be written otherwise; it only forwards to the system's")]
// SAFETY: every call is forwarded to the system allocator with the caller's own arguments; counting uses a
// const-initialised thread-local `Cell` without destructor, which neither allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_one();
        // SAFETY: as the caller's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count_one();
        // SAFETY: as the caller's.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count_one();
        // SAFETY: as the caller's.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as the caller's.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Items after which every buffer has circulated through its link, the filter's history is full and every Vec
/// has grown to its final size.
const WARM_UP: u64 = 30;
const FRAMES: u64 = 130;

/// Number of one-time allocations that a thread may make in links: a channel allocates a list of waiters at
/// the first wait (two channels per link, up to three links, and the shutdown), and a context for the thread.
/// When that happens depends on timing. One allocation per frame would give 100.
const FIRST_WAITS: u64 = 10;

/// Allocations after the warm-up.
#[derive(Clone, Copy, Debug, Default)]
struct Allocations {
    in_steps: u64,
    in_loop_and_links: u64,
}

/// A stage whose thread's allocations are counted from a given step on.
struct Counted<'a, S> {
    stage: S,
    steps: u64,
    counted: &'a mut Allocations,
}

impl<'a, S> Counted<'a, S> {
    fn new(stage: S, counted: &'a mut Allocations) -> Self {
        Self { stage, steps: 0, counted }
    }
}

impl<S: Stage> Stage for Counted<'_, S> {
    type Input = S::Input;
    type Output = S::Output;

    fn step(&mut self, input: &S::Input, output: &mut S::Output) -> Result<Flow> {
        self.counted.in_loop_and_links += COUNT.take().unwrap_or(0);
        let is_counting = self.steps >= WARM_UP;
        self.steps += 1;
        COUNT.set(is_counting.then_some(0));
        let flow = self.stage.step(input, output);
        self.counted.in_steps += COUNT.replace(is_counting.then_some(0)).unwrap_or(0);
        flow
    }
}

impl<S> Drop for Counted<'_, S> {
    fn drop(&mut self) {
        self.counted.in_loop_and_links += COUNT.take().unwrap_or(0);
    }
}

/// Raw 640 x 480 codes in which a bright spot moves.
struct Camera {
    number: u64,
    bayer: Option<Bayer>,
}

impl Stage for Camera {
    type Input = Tick;
    type Output = Frame;

    fn step(&mut self, _: &Tick, frame: &mut Frame) -> Result<Flow> {
        if self.number == FRAMES {
            return Ok(Flow::End);
        }
        let number = self.number;
        self.number += 1;
        let code = |index: u64| {
            let (row, column) = (index / 640, index % 640);
            let spot = (200 + number, 250 + 2 * number);
            if row.abs_diff(spot.0) < 3 && column.abs_diff(spot.1) < 3 { 4095 } else { 200 + column as u16 }
        };
        *frame = Frame {
            stamp: Stamp {
                sequence: number,
                capture_time_ns: 40_000_000 * number as i64,
                lost_before: 0,
                frame_rate_hz: 25.0,
            },
            width: 640,
            height: 480,
            channels: 1,
            bayer: self.bayer,
            saturation: f32::INFINITY,
            pixels: Pixels::Codes((0..640 * 480).map(code).collect()),
        };
        Ok(Flow::Send)
    }
}

struct End;

impl Stage for End {
    type Input = ReferencedList;
    type Output = ();

    fn step(&mut self, list: &ReferencedList, (): &mut ()) -> Result<Flow> {
        assert!(list.list.power[1] > 0.0 && list.list.filter_delay_frames > 0);
        Ok(Flow::Send)
    }
}

/// The frames, and how they are processed.
#[derive(Clone, Copy, Debug)]
struct Case {
    sampler: Sampler,
    error_target: Option<f32>,
    bayer: Option<Bayer>,
}

/// Allocations of calibrate, light and filter over the frames after the warm-up.
fn allocations(case: Case, disturb: fn(&mut Vec<Vec<u8>>)) -> [Allocations; 3] {
    let Case { sampler, error_target, bayer } = case;
    let shape = PolarShape::hemisphere(360, 90);
    let lens = Lens::new(LensParameters {
        width: 640,
        height: 480,
        fx: 150.0,
        fy: 150.0,
        cx: 320.0,
        cy: 240.0,
        k: [0.0; 4],
        field_of_view_rad: 3.1,
    })
    .unwrap();
    let response =
        Response::new(ResponseModel::Linear { black_level: 64, white_level: 4095, gain: 1e-3 }).unwrap();
    let projection = Projection::Fisheye(lens);
    let frame_to_polar = match bayer {
        None => FrameToPolar::new(&projection, LOOKING_UP, shape).unwrap(),
        Some(bayer) => FrameToPolar::mosaic(&projection, bayer, LOOKING_UP, shape).unwrap(),
    };
    let options = Options { count: 300, sampler, error_target, ..Options::default() };
    let extractor = Extractor::new(shape, &options).unwrap();
    let filter = RateFilter::new(&FilterOptions::default()).unwrap();

    let (clock, shutdown) = (Clock::simulated(), Shutdown::new());
    let metrics = ["camera", "calibrate", "light", "filter", "end"].map(Metrics::new);
    let (frames_in, frames_out) = bounded(2, &shutdown, Frame::default);
    let (maps_in, maps_out) = bounded(2, &shutdown, || PolarMap::black(shape));
    let (map_copies_in, map_copies_out) = lossy(2, Counter::default(), &shutdown, || PolarMap::black(shape));
    let (lists_in, lists_out) = bounded(2, &shutdown, ReferencedList::default);
    let (filtered_in, filtered_out) = bounded(2, &shutdown, ReferencedList::default);
    let (list_copies_in, list_copies_out) = bounded(2, &shutdown, LightList::default);
    let mut maps = FanOut::new(PolarMap::black(shape));
    maps.set_next(maps_in);
    maps.add(map_copies_in, 2);
    let mut filtered = FanOut::new(ReferencedList::default());
    filtered.set_next(filtered_in);
    filtered.add(list_copies_in, 1);
    let mut counts = [Allocations::default(); 3];
    let [of_calibrate, of_light, of_filter] = &mut counts;
    let disturbed = Disturbed { stage: Filter(filter), disturb, taken: Vec::with_capacity(1000) };
    std::thread::scope(|scope| {
        let (clock, shutdown, metrics) = (&clock, &shutdown, &metrics);
        scope.spawn(move || {
            let mut maps = map_copies_out;
            while maps.receive().is_some() {}
        });
        scope.spawn(move || {
            let mut lists = list_copies_out;
            let mut count = 0;
            while lists.receive().is_some() {
                count += 1;
            }
            assert_eq!(count, FRAMES);
        });
        scope.spawn(|| {
            let camera = Camera { number: 0, bayer };
            run(camera, Ticks(shutdown.clone()), frames_in, clock, shutdown, &metrics[0])
        });
        scope.spawn(|| {
            let stage = Counted::new(Calibrate::new(frame_to_polar, response, &metrics[1]), of_calibrate);
            run(stage, frames_out, maps, clock, shutdown, &metrics[1])
        });
        scope.spawn(|| {
            let stage = Counted::new(Light(extractor), of_light);
            run(stage, maps_out, lists_in, clock, shutdown, &metrics[2])
        });
        scope.spawn(|| {
            run(Counted::new(disturbed, of_filter), lists_out, filtered, clock, shutdown, &metrics[3])
        });
        run(End, filtered_out, Nowhere, clock, shutdown, &metrics[4]).unwrap();
    });
    assert_eq!(metrics.each_ref().map(|metrics| metrics.frames.get()), [FRAMES; 5]);
    counts
}

/// A filter that performs an additional action in every step.
struct Disturbed {
    stage: Filter,
    disturb: fn(&mut Vec<Vec<u8>>),
    taken: Vec<Vec<u8>>,
}

impl Stage for Disturbed {
    type Input = ReferencedList;
    type Output = ReferencedList;

    fn step(&mut self, input: &ReferencedList, output: &mut ReferencedList) -> Result<Flow> {
        (self.disturb)(&mut self.taken);
        self.stage.step(input, output)
    }
}

#[test]
fn a_frame_in_the_steady_state_allocates_nothing() {
    let plain = |sampler| Case { sampler, error_target: None, bayer: None };
    for case in [
        plain(Sampler::Persistent),
        plain(Sampler::Adaptive),
        Case { error_target: Some(0.003), ..plain(Sampler::Adaptive) },
        Case { bayer: Some(Bayer::Rggb), ..plain(Sampler::Refined) },
        plain(Sampler::EqualPower),
    ] {
        let counts = allocations(case, |_| ());
        println!("{case:?}, {} frames, calibrate, light, filter: {counts:?}", FRAMES - WARM_UP);
        for count in counts {
            assert_eq!(count.in_steps, 0, "{case:?}: {counts:?}");
            assert!(count.in_loop_and_links <= FIRST_WAITS, "{case:?}: {counts:?}");
        }
    }
}

#[test]
fn one_allocation_a_frame_is_seen() {
    let case = Case { sampler: Sampler::Adaptive, error_target: None, bayer: None };
    let counts = allocations(case, |taken| taken.push(vec![1]));
    assert_eq!(counts.map(|count| count.in_steps), [0, 0, FRAMES - WARM_UP]);
}

#[test]
fn merging_exposures_allocates_nothing_after_the_first_cycle() {
    let model = ResponseModel::Linear { black_level: 0, white_level: 4095, gain: 1e-3 };
    let response = Response::new(model).unwrap();
    let mut merge = ExposureMerge::new(&response, &[1.0, 0.1, 0.01], &SensorNoise::default()).unwrap();
    let frames = [4095, 700, 70].map(|code| Frame {
        width: 64,
        height: 48,
        channels: 3,
        pixels: Pixels::Codes(vec![code; 64 * 48 * 3]),
        ..Frame::default()
    });
    let mut radiance = Frame::default();
    for cycle in 0..5 {
        COUNT.set((cycle > 0).then_some(0));
        for (index, frame) in frames.iter().enumerate() {
            merge.add(frame, index).unwrap();
        }
        merge.finish(&mut radiance).unwrap();
        let count = COUNT.replace(None);
        assert_eq!(count.unwrap_or(0), 0, "cycle {cycle}");
    }
}
