use super::*;
use crate::files::read;
use lightcast_core::image::Stamp;

fn frame(sequence: u64) -> Frame {
    let stamp = Stamp {
        sequence,
        capture_time_ns: 5_000_000_000 + 40_000_000 * sequence as i64,
        lost_before: 0,
        frame_rate_hz: 25.0,
    };
    let codes = (0..12).map(|pixel| 100 * pixel + sequence as u16).collect();
    Frame { stamp, width: 4, height: 3, pixels: Pixels::Codes(codes), ..Frame::default() }
}

fn recording() -> Recording {
    Recording {
        version: 1,
        source: "test".to_owned(),
        exposure_s: Some(0.01),
        calibration: Some(serde_json::json!({ "lens": { "fx": 1.0 } })),
        utc_from_capture_ns: Some(7),
    }
}

fn sidecar(folder: &std::path::Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join(SIDECAR)).unwrap()).unwrap()
}

#[test]
fn a_recording_holds_the_codes_and_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("new");
    let metrics = Metrics::new("record");
    let mut record = Record::new(folder.clone(), recording(), None, 3, &metrics).unwrap();
    let flows = [3, 4, 6, 7].map(|sequence| record.step(&frame(sequence), &mut ()).unwrap());
    assert_eq!(flows, [Flow::Send, Flow::Send, Flow::Send, Flow::End]);
    let early = sidecar(&folder);
    assert_eq!((&early["frames_written"], &early["is_complete"]), (&1.into(), &false.into()));
    record.finish(true).unwrap();
    let found = sidecar(&folder);
    assert_eq!(found["sequence_numbers"], serde_json::json!([3, 6]));
    assert_eq!((&found["frames_written"], &found["frames_missing"]), (&3.into(), &1.into()));
    assert_eq!((&found["samples"], &found["source"]), (&"codes".into(), &"test".into()));
    assert_eq!(found["is_complete"], true);
    let mut read_back = Frame::default();
    let attributes = read(&folder.join("frame.000006.exr"), &mut read_back).unwrap();
    assert_eq!(attributes.capture_time_ns, Some(frame(6).stamp.capture_time_ns));
    assert_eq!(read_back.pixels, frame(6).pixels);
    let again = Record::new(folder, recording(), None, 3, &metrics).err().unwrap();
    assert!(again.to_string().contains("is not empty"), "{again}");
}

#[test]
fn radiance_is_cut_at_the_largest_half_float_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let metrics = Metrics::new("record");
    let table: Vec<f32> = (0..=1000).map(|code| code as f32 * 100.0).collect();
    let mut record = Record::new(folder.path().to_owned(), recording(), Some(table), 9, &metrics).unwrap();
    record.step(&frame(0), &mut ()).unwrap();
    let mut read_back = Frame::default();
    read(&folder.path().join("frame.000000.exr"), &mut read_back).unwrap();
    let Pixels::Radiance(values) = read_back.pixels else { panic!("codes") };
    assert_eq!(values[..3], [0.0, 10_000.0, 20_000.0]);
    // Codes 700 to 1100 are 70,000 and more; the largest half is exact.
    assert_eq!(values[7..], [HALF_MAX; 5]);
    assert_eq!(metrics.counters(), [("pixels beyond half floats", 5)]);
}

#[test]
fn radiance_is_recorded_as_it_comes_or_as_half_floats_that_are_counted() {
    let metrics = Metrics::new("record");
    let values = vec![1e6, 0.1, 1e-9, 0.0];
    let frame = Frame { width: 4, height: 1, pixels: Pixels::Radiance(values.clone()), ..frame(0) };
    for (table, expected) in [(None, values), (Some(Vec::new()), vec![HALF_MAX, 0.099_975_586, 0.0, 0.0])] {
        let folder = tempfile::tempdir().unwrap();
        let mut record = Record::new(folder.path().to_owned(), recording(), table, 9, &metrics).unwrap();
        record.step(&frame, &mut ()).unwrap();
        let mut read_back = Frame::default();
        read(&folder.path().join("frame.000000.exr"), &mut read_back).unwrap();
        assert_eq!(read_back.pixels, Pixels::Radiance(expected));
    }
    assert_eq!(metrics.counters(), [("pixels beyond half floats", 2)]);
}
