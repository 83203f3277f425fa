//! From a driver to light lists through the product's service: a simultaneous recording holds what was
//! captured, and both the recording and the written pictures replay to the lists of the live run.

use crate::frames::{codes, lamp};
use crate::kernel::Layout;
use crate::live::{Ended, LOOPBACK, Lines, Live, VIVID, camera, config, limit};
use crate::loopback::Loopback;
use crate::messages;
use crate::vivid;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use lightcast::config::Config;
use lightcast::files::read;
use lightcast::rt::Shutdown;
use lightcast::service::{Ends, Output, RecordOptions, Service};
use lightcast_core::image::{Bayer, Frame, Pixels};
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Lists of a sequence, played from a fresh filter.
fn replay(config: &Config) -> String {
    let lines = Lines::default();
    let ends = Ends { output: Some(Output::new("memory", lines.clone())), ..Ends::default() };
    let service = Service::start(config, ends, &Shutdown::new()).unwrap();
    service.join(Duration::from_millis(5), || ()).unwrap();
    lines.text()
}

fn recording(folder: &Path) -> RecordOptions {
    RecordOptions { folder: folder.join("recording"), queue: 200, ..RecordOptions::default() }
}

/// Codes and colours of the recorded frames, in order.
fn recorded(folder: &Path) -> Vec<(Vec<u16>, Option<Bayer>)> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder.join("recording")).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "exr"));
    paths.sort();
    let mut frame = Frame::default();
    let read = |path: &PathBuf| {
        read(path, &mut frame).unwrap();
        let Pixels::Codes(codes) = &frame.pixels else { panic!("{} has no codes", path.display()) };
        (codes.clone(), frame.bayer)
    };
    paths.iter().map(read).collect()
}

/// Checks that the recording replays to the lists of the live run.
fn replays_to_the_same(folder: &Path, layout: Layout, mask: u16, ended: &Ended) {
    let record = ended.summary.stage("record").unwrap();
    let source = ended.summary.stage("source").unwrap();
    assert_eq!((record.frames.get(), record.drops.get()), (source.frames.get(), 0));
    let config = config(folder, "kind = \"sequence\"\npath = \"recording/\"\npace = \"fast\"", layout, mask);
    assert!(replay(&config) == ended.text, "the recording plays to other lists");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn lists_of_16_bits_are_those_of_the_written_pictures() {
    let layout = Layout::two_bytes(b"Y16 ", 1024, 1024);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let pictures: Vec<_> = (0..8).map(|number| lamp(layout, number, 0xffff)).collect();
    let mut writer = Loopback::open(layout);
    writer.write(pictures[0]);
    let source = format!("{}\nlinks = \"replay\"", camera(LOOPBACK, layout));
    let live = Live::start(&config(folder, &source, layout, 0xffff), Some(recording(folder)));
    live.run_on(1);
    for (number, picture) in pictures.iter().enumerate().skip(1) {
        writer.write(picture);
        live.until("captured", |live| live.frames() == number as u64 + 1);
    }
    live.until("written", |live| {
        live.summary().stage("publish").unwrap().frames.get() == pictures.len() as u64
    });
    let ended = live.end();
    assert_eq!(ended.stamps.len(), pictures.len(), "{}", ended.summary);
    assert_eq!(ended.longest_gap(), 0);
    ended.has_no_restarts();
    for (number, (found, _)) in recorded(folder).into_iter().enumerate() {
        assert!(found == codes(pictures[number], layout), "recorded frame {number} is another one");
    }
    replays_to_the_same(folder, layout, 0xffff, &ended);

    // The pictures as they were written, in files that were not made by the product.
    let written = folder.join("written");
    fs::create_dir(&written).unwrap();
    for (number, picture) in pictures.iter().enumerate() {
        let path = written.join(format!("picture.{number:04}.png"));
        let file = BufWriter::new(File::create(path).unwrap());
        // Noise cannot be compressed.
        PngEncoder::new_with_quality(file, CompressionType::Uncompressed, FilterType::NoFilter)
            .write_image(picture, layout.width, layout.height, ExtendedColorType::L16)
            .unwrap();
    }
    let source = "kind = \"sequence\"\npath = \"written/\"\npace = \"fast\"\nframe_rate_hz = 30.0";
    let replayed = replay(&config(folder, source, layout, 0xffff));
    let (live, replayed) = (without_stamps(&ended.text), without_stamps(&replayed));
    assert!(live == replayed, "the written pictures have other lights");
    assert_eq!(live.len(), pictures.len());
    assert!(live.windows(2).all(|pair| pair[0] != pair[1]), "the lamp moves");
}

/// Lists without sequence numbers and times.
fn without_stamps(text: &str) -> Vec<serde_json::Value> {
    let without = |line: &str| {
        let mut list: serde_json::Value = serde_json::from_str(line).unwrap();
        let keys = list.as_object_mut().unwrap();
        assert!(keys.remove("capture_time_ns").is_some() && keys.remove("sequence").is_some());
        list
    };
    text.lines().map(without).collect()
}

/// Pictures shown one after the other, each for some frames.
fn lists_of_shown_pictures(layout: Layout, bayer: Option<Bayer>) {
    vivid::fresh();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let pictures: Vec<_> = (0..5).map(|number| lamp(layout, number, 0x0fff)).collect();
    let mut output = vivid::Output::open(layout);
    output.show(pictures[0]);
    let source = format!("{}\nlinks = \"replay\"\nbuffers = 2", camera(VIVID, layout));
    let live = Live::start(&config(folder, &source, layout, 0x0fff), Some(recording(folder)));
    live.run_on(2);
    for picture in &pictures[1..] {
        output.show(picture);
        // The driver's two buffers hold the previous picture, and a third is being read.
        live.run_on(4);
    }
    // Half a dozen large frames are in the pipeline, and none of them is dropped.
    let (ended, outcome) = live.finish(limit());
    outcome.unwrap();
    ended.has_no_restarts();
    let mut shown = 0;
    for (number, (found, colours)) in recorded(folder).into_iter().enumerate() {
        assert_eq!(colours, bayer, "frame {number}");
        let ahead = pictures[shown..].iter().position(|picture| found == codes(picture, layout));
        shown += ahead.unwrap_or_else(|| panic!("recorded frame {number} is no picture from {shown} on"));
    }
    assert_eq!(shown, pictures.len() - 1, "all were captured");
    assert_eq!(ended.stamps.len() as u64, ended.summary.stage("source").unwrap().frames.get());
    replays_to_the_same(folder, layout, 0x0fff, &ended);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn lists_of_12_bits_are_those_of_the_recording() {
    lists_of_shown_pictures(Layout::two_bytes(b"Y12 ", 1280, 720), None);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn lists_of_a_mosaic_are_those_of_the_recording() {
    lists_of_shown_pictures(Layout::two_bytes(b"RG12", 1280, 720), Some(Bayer::Rggb));
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn full_disk_ends_the_recording_alone() {
    let layout = Layout::two_bytes(b"Y16 ", 160, 128);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut writer = Loopback::open(layout);
    writer.write(lamp(layout, 0, 0xffff));
    let source = format!("{}\nlinks = \"replay\"", camera(LOOPBACK, layout));
    let config_live = config(folder, &source, layout, 0xffff);
    // A disk of 512 KiB: the guest's init script mounts it.
    let disk = Path::new("/small/recording");
    let _none = fs::remove_dir_all(disk);
    let options = RecordOptions { folder: disk.to_owned(), queue: 200, ..RecordOptions::default() };
    let live = Live::start(&config_live, Some(options));
    live.run_on(1);
    for number in 1..20 {
        writer.write(lamp(layout, u32::try_from(number).unwrap(), 0xffff));
        live.until("captured", |live| live.frames() == number + 1);
    }
    live.until("the end of the recording", |_| messages::count("record has ended, all else goes on") == 1);
    let (ended, outcome) = live.finish(limit());
    assert_eq!(ended.stamps.len(), 20, "{}", ended.summary);
    let message = outcome.unwrap_err().to_string();
    assert!(message.contains("/small/recording/frame.") && message.contains("os error 28"), "{message}");
    let sidecar: serde_json::Value =
        serde_json::from_slice(&fs::read(disk.join("recording.json")).unwrap()).unwrap();
    let written = sidecar["frames_written"].as_u64().unwrap();
    let files: Vec<_> = fs::read_dir(disk)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| (entry.file_name(), entry.metadata().unwrap().len()))
        .collect();
    assert!((2..20).contains(&written), "{sidecar} {files:?}");
    assert_eq!(files.len() as u64, written + 1, "{files:?}");
    assert_eq!(sidecar["is_complete"], false);
    let source = "kind = \"sequence\"\npath = \"/small/recording/\"\npace = \"fast\"";
    let replayed = replay(&config(folder, source, layout, 0xffff));
    assert_eq!(replayed.lines().count() as u64, written);
    assert!(ended.text.starts_with(&replayed), "what was recorded plays to other lists");
}
