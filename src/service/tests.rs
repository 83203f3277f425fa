use super::*;
use crate::rt::Counter;
use crate::rt::stage::{Flow, Stage};
use std::path::Path;

/// An end: counts lists and their lights.
struct CountLists {
    lists: Counter,
    lights: Counter,
}

impl Stage for CountLists {
    type Input = LightList;
    type Output = ();

    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        self.lists.add(1);
        self.lights.add(list.lights.len() as u64);
        Ok(Flow::Send)
    }
}

fn bundled() -> Config {
    Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("config/replay.toml")).unwrap()
}

#[test]
fn an_end_is_a_stage_and_one_line() {
    let (lists, lights) = (Counter::default(), Counter::default());
    let count = CountLists { lists: lists.clone(), lights: lights.clone() };
    let ends = Ends { readers: vec![ListReader::new("count", count)], ..Ends::default() };
    let service = Service::start(&bundled(), ends, &Shutdown::new()).unwrap();
    let summary = service.summary();
    service.join(Duration::from_millis(1), || ()).unwrap();
    assert_eq!((lists.get(), lights.get()), (100, 6400));
    let names: Vec<_> = summary.stages().iter().map(|stage| stage.name()).collect();
    assert_eq!(names, ["source", "calibrate", "light", "filter", "count"]);
    assert_eq!(summary.stage("count").unwrap().frames.get(), 100);
}

#[test]
fn a_service_that_nobody_listens_to_ends_at_once() {
    let service = Service::start(&bundled(), Ends::default(), &Shutdown::new()).unwrap();
    let summary = service.summary();
    service.join(Duration::from_millis(1), || ()).unwrap();
    assert!(summary.stage("source").unwrap().frames.get() < 100, "{summary}");
}
