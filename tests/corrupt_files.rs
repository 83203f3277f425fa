//! Damaged picture files: whatever their bytes, reading them neither panics nor takes excessive memory.
//!
//! 2,000 mutations of a small file of each kind, with a fixed seed: a few bytes are replaced, and every
//! fourth file is also truncated. The files are damaged on the disk because the reader takes paths.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use lightcast::error::Kind;
use lightcast::files::{read, write_exr, write_png16};
use lightcast_core::image::{Frame, Pixels};
use std::fs;
use std::path::Path;

const MUTATIONS: usize = 2000;

/// Marsaglia's xorshift64.
struct XorShift(u64);

impl XorShift {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }
}

fn radiance(width: usize, height: usize) -> Frame {
    let mut random = XorShift(7);
    let values = (0..width * height * 3).map(|_| random.below(4096) as f32 / 64.0).collect();
    Frame { width, height, channels: 3, pixels: Pixels::Radiance(values), ..Frame::default() }
}

/// Panics inside libraries are caught. The backtrace of one would map the program's debug information, which
/// would then count as memory of the reader.
fn say_panics_without_backtrace() {
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
}

/// Largest resident size of this process so far, in MB; `None` where the system does not report it.
fn peak_resident_mb() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

/// Reads mutations of `original`; half of the mutations are within its first `head` bytes.
fn survive(name: &str, original: &[u8], head: usize, mutations: usize, seed: u64) {
    say_panics_without_backtrace();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut random = XorShift(seed);
    let mut frame = Frame::default();
    let mut readable = 0;
    fs::write(&path, original).unwrap();
    read(&path, &mut frame).expect("the original is a picture");
    for mutation in 0..mutations {
        let mut bytes = original.to_vec();
        for _ in 0..1 + random.below(4) {
            let range = if random.below(2) == 0 { head } else { bytes.len() };
            let at = random.below(range.min(bytes.len()));
            bytes[at] = match random.below(4) {
                0 => bytes[at] ^ (1 << random.below(8)),
                1 => 0xff,
                2 => 0,
                _ => random.next() as u8,
            };
        }
        if mutation % 4 == 3 {
            bytes.truncate(random.below(bytes.len()));
        }
        fs::write(&path, &bytes).unwrap();
        match read(&path, &mut frame) {
            Ok(_) => {
                readable += 1;
                let samples = match &frame.pixels {
                    Pixels::Codes(codes) => codes.len(),
                    Pixels::Radiance(values) => values.len(),
                };
                assert!(samples > 0 && samples == frame.width * frame.height * frame.channels);
            }
            Err(error) => {
                assert_eq!(error.kind(), Kind::BadFrame);
                assert!(error.to_string().starts_with(path.to_str().unwrap()), "{error}");
                assert_eq!((frame.width, frame.height), (0, 0));
            }
        }
    }
    eprintln!("{name}: {readable} of {mutations} mutations are still pictures");
    if let Some(mb) = peak_resident_mb() {
        eprintln!("{name}: at most {mb} MB resident");
        // The originals take less than 100 kB as floats; all tests of this file share the process.
        assert!(mb < 256, "{name}: {mb} MB");
    }
    // Some mutations have no effect, but not all of them.
    assert!(0 < readable && readable < mutations, "{name}: {readable} of {mutations}");
}

fn bytes_of(write: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("original");
    write(&path);
    fs::read(&path).unwrap()
}

#[test]
fn mutated_jpeg_files_never_panic() {
    let mut random = XorShift(13);
    let samples: Vec<u8> = (0..48 * 40 * 3).map(|_| random.below(256) as u8).collect();
    let original = bytes_of(|path| {
        let mut file = fs::File::create(path).unwrap();
        let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 80);
        encoder.encode(&samples, 48, 40, image::ExtendedColorType::Rgb8).unwrap();
    });
    survive("a.jpg", &original, 640, MUTATIONS, 0x94d0_49bb_1331_11eb);
}

#[test]
fn mutated_open_exr_files_never_panic() {
    let original = bytes_of(|path| write_exr(path, &radiance(48, 40), Some(25.0), true).unwrap());
    survive("a.exr", &original, 420, MUTATIONS, 0x9e37_79b9_7f4a_7c15);
}

#[test]
fn mutated_open_exr_files_of_every_compression_never_panic() {
    use exr::prelude::{
        AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes,
        LineOrder, Vec2, WritableImage, f16,
    };
    let mut random = XorShift(11);
    let samples: Vec<f16> = (0..48 * 40).map(|_| f16::from_f32(random.below(256) as f32)).collect();
    for (number, compression) in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::DWAA(None),
        Compression::DWAB(None),
    ]
    .into_iter()
    .enumerate()
    {
        let tiles = Blocks::Tiles(Vec2(16, 16));
        let blocks = if number % 2 == 0 { tiles } else { Blocks::ScanLines };
        let channels = ["B", "G", "R"].map(|name| AnyChannel::new(name, FlatSamples::F16(samples.clone())));
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let layer = Layer::new(
            (48, 40),
            LayerAttributes::default(),
            encoding,
            AnyChannels::sort(channels.into_iter().collect()),
        );
        let original = bytes_of(|path| {
            Image::from_layer(layer).write().non_parallel().to_file(path).unwrap();
        });
        let name = format!("{compression}.exr");
        survive(&name, &original, 420, MUTATIONS / 5, 0x2545_f491_4f6c_dd1d + number as u64);
    }
}

#[test]
fn mutated_radiance_files_never_panic() {
    let header = b"#?RADIANCE\nEXPOSURE=2.5\nEXPOSURE=0.125\nFORMAT=32-bit_rle_rgbe\n\n-Y 40 +X 48\n";
    let mut original = header.to_vec();
    let mut random = XorShift(5);
    for row in 0..40 {
        if row % 2 == 0 {
            // Run-length coded components: 40 equal ones, then 8 literals.
            original.extend_from_slice(&[2, 2, 0, 48]);
            for _ in 0..4 {
                original.extend_from_slice(&[128 + 40, 120 + random.below(16) as u8, 8]);
                original.extend((0..8).map(|_| 120 + random.below(16) as u8));
            }
        } else {
            // The old form: a pixel, a run of 46 repetitions, another pixel.
            original.extend_from_slice(&[9, 200, 30, 130, 1, 1, 1, 46, 40, 50, 60, 129]);
        }
    }
    survive("a.hdr", &original, header.len(), MUTATIONS, 0xd1b5_4a32_d192_ed03);
}

#[test]
fn mutated_png_files_never_panic() {
    let mut random = XorShift(3);
    let codes = (0..48 * 40).map(|_| random.below(65_536) as u16).collect();
    let frame =
        Frame { width: 48, height: 40, channels: 1, pixels: Pixels::Codes(codes), ..Frame::default() };
    let original = bytes_of(|path| write_png16(path, &frame).unwrap());
    survive("a.png", &original, 60, MUTATIONS, 0x94d0_49bb_1331_11eb);
}
