use crate::error::Result;
use crate::files::{Attributes, read};
use exr::math::RoundingMode;
use exr::meta::attribute::{Chromaticities, EnvironmentMap};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, Levels, LineOrder, RipMaps, SmallVec, Vec2, WritableImage, f16,
};
use lightcast_core::image::{Frame, LatLongCentres, Pixels};
use std::io::Cursor;

type Channels = AnyChannels<FlatSamples>;

fn channels(list: &[(&str, FlatSamples)]) -> Channels {
    let list: SmallVec<[_; 4]> =
        list.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone())).collect();
    AnyChannels::sort(list)
}

fn floats(count: usize, offset: f32) -> FlatSamples {
    FlatSamples::F32((0..count).map(|n| n as f32 + offset).collect())
}

fn part(name: &str, size: (usize, usize), encoding: Encoding, channels: Channels) -> Layer<Channels> {
    Layer::new(size, LayerAttributes::named(name), encoding, channels)
}

fn bytes(layers: Vec<Layer<Channels>>) -> Vec<u8> {
    let window = IntegerBounds::from_dimensions(layers[0].size);
    bytes_with(ImageAttributes::new(window), layers)
}

fn bytes_with(attributes: ImageAttributes, layers: Vec<Layer<Channels>>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_layers(attributes, layers);
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn read_bytes(bytes: &[u8], frame: &mut Frame) -> Result<Attributes> {
    super::read(Cursor::new(bytes), bytes.len() as u64, frame, None)
}

fn refusal(bytes: &[u8]) -> String {
    read_bytes(bytes, &mut Frame::default()).unwrap_err().to_string()
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from).expect("pattern is there");
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

#[test]
fn tiles_of_every_kind_and_compression_give_the_picture() {
    // 50 x 30 in tiles of 16 x 8: cut at both edges.
    let values: Vec<f32> = (0..1500).map(|n| n as f32).collect();
    let mut frame = Frame::default();
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 8))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let list = [("Y", FlatSamples::F32(values.clone())), ("Z", floats(1500, 0.5))];
            read_bytes(&bytes(vec![part("a", (50, 30), encoding, channels(&list))]), &mut frame).unwrap();
            assert_eq!((frame.width, frame.height, frame.channels), (50, 30, 1));
            assert_eq!(frame.pixels, Pixels::Radiance(values.clone()), "{compression}, {blocks:?}");
        }
    }
}

#[test]
fn mip_maps_and_rip_maps_give_their_full_resolution() {
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::Tiles(Vec2(4, 4)),
        line_order: LineOrder::Increasing,
    };
    let full = floats(10 * 6, 0.0);
    // 10 x 6, then halved in both directions and rounded down: 5 x 3, 2 x 1, 1 x 1.
    let levels = vec![full.clone(), floats(15, 1000.0), floats(2, 2000.0), floats(1, 3000.0)];
    let mip = Levels::Mip { rounding_mode: RoundingMode::Down, level_data: levels };
    // The same with each direction halved on its own: widths 10, 5, 2, 1 for heights 6, 3, 1.
    let sizes = [6, 3, 1].into_iter().flat_map(|height| [10, 5, 2, 1].map(|width| width * height));
    let rip = Levels::Rip {
        rounding_mode: RoundingMode::Down,
        level_data: RipMaps {
            map_data: sizes.enumerate().map(|(n, size)| floats(size, 1000.0 * n as f32)).collect(),
            level_count: Vec2(4, 3),
        },
    };
    for levels in [mip, rip] {
        let channels = AnyChannels::sort([AnyChannel::new("Y", levels)].into_iter().collect());
        let layer = Layer::new((10, 6), LayerAttributes::default(), encoding, channels);
        let mut file = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut file).unwrap();
        let mut frame = Frame::default();
        read_bytes(file.get_ref(), &mut frame).unwrap();
        assert_eq!((frame.width, frame.height), (10, 6));
        assert_eq!(frame.pixels, Pixels::Radiance((0..60).map(|n| n as f32).collect()));
    }
}

#[test]
fn lossy_compressions_come_close() {
    let values: Vec<f32> = (0..4096).map(|n| 1.0 + (n % 64) as f32 / 64.0).collect();
    let halves = FlatSamples::F16(values.iter().map(|&value| f16::from_f32(value)).collect());
    let mut frame = Frame::default();
    for compression in [Compression::B44, Compression::B44A, Compression::DWAA(None), Compression::DWAB(None)]
    {
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let file = bytes(vec![part("a", (64, 64), encoding, channels(&[("Y", halves.clone())]))]);
        read_bytes(&file, &mut frame).unwrap();
        let Pixels::Radiance(decoded) = &frame.pixels else { panic!("codes") };
        // B44 keeps 6 bits of the difference in a block of 4 x 4, DWA at its default level 45 about as many.
        for (value, expected) in decoded.iter().zip(&values) {
            assert!((value - expected).abs() < 0.02, "{compression}: {value} for {expected}");
        }
    }
}

#[test]
fn uint_and_mixed_channel_types_become_floats() {
    let list = [
        ("A", floats(6, 0.0)),
        ("R", FlatSamples::U32(vec![0, 1, 65_535, 70_000, 16_777_216, 5])),
        ("G", FlatSamples::F16((0..6_u8).map(|n| f16::from_f32(f32::from(n) / 4.0)).collect())),
        ("B", floats(6, 10.0)),
    ];
    let mut frame = Frame::default();
    read_bytes(&bytes(vec![part("a", (3, 2), Encoding::UNCOMPRESSED, channels(&list))]), &mut frame).unwrap();
    let Pixels::Radiance(values) = frame.pixels else { panic!("codes") };
    assert_eq!(values[..6], [0.0, 0.0, 10.0, 1.0, 0.25, 11.0]);
    assert_eq!(values[6..12], [65_535.0, 0.5, 12.0, 70_000.0, 0.75, 13.0]);
    assert_eq!(values[12], 16_777_216.0);
}

#[test]
fn first_part_with_rgb_goes_before_luminance_and_display_windows_may_lie_anywhere() {
    let rgb =
        |offset| channels(&[("R", floats(4, offset)), ("G", floats(4, offset)), ("B", floats(4, offset))]);
    let mut moved = part("picture", (2, 2), Encoding::FAST_LOSSLESS, rgb(7.0));
    moved.attributes = moved.attributes.with_position(Vec2(-3, 1000));
    let parts = vec![
        part("depth", (5, 1), Encoding::FAST_LOSSLESS, channels(&[("Y", floats(5, 0.0))])),
        part(
            "prefixed",
            (2, 2),
            Encoding::FAST_LOSSLESS,
            channels(&[("x.B", floats(4, 0.0)), ("x.G", floats(4, 0.0)), ("x.R", floats(4, 0.0))]),
        ),
        moved,
        part("later", (2, 2), Encoding::FAST_LOSSLESS, rgb(70.0)),
    ];
    let mut frame = Frame::default();
    let display = IntegerBounds::new(Vec2(-3, 1000), Vec2(2, 2));
    read_bytes(&bytes_with(ImageAttributes::new(display), parts), &mut frame).unwrap();
    let expected = [7.0, 8.0, 9.0, 10.0].iter().flat_map(|&value| [value; 3]).collect();
    assert_eq!((frame.width, frame.height, frame.channels), (2, 2, 3));
    assert_eq!(frame.pixels, Pixels::Radiance(expected));
}

/// A picture of one channel in a display window of 4 x 3 at (10, 20), its data window of this size at
/// `position`.
fn placed(position: (i32, i32), size: (usize, usize), encoding: Encoding) -> Result<Vec<f32>> {
    let count = size.0 * size.1;
    let mut layer = part("a", size, encoding, channels(&[("Y", floats(count, 1.0))]));
    layer.attributes = layer.attributes.with_position(Vec2(position.0, position.1));
    let display = IntegerBounds::new(Vec2(10, 20), Vec2(4, 3));
    // What was there before must not shine through.
    let mut frame =
        Frame { width: 4, height: 3, pixels: Pixels::Radiance(vec![99.0; 12]), ..Frame::default() };
    read_bytes(&bytes_with(ImageAttributes::new(display), vec![layer]), &mut frame)?;
    assert_eq!((frame.width, frame.height, frame.channels), (4, 3, 1));
    let Pixels::Radiance(values) = frame.pixels else { panic!("codes") };
    Ok(values)
}

#[test]
fn the_data_window_lies_where_it_says_in_the_display_window() {
    let tiles = Encoding {
        blocks: Blocks::Tiles(Vec2(2, 2)),
        line_order: LineOrder::Unspecified,
        ..Encoding::FAST_LOSSLESS
    };
    for encoding in [Encoding::FAST_LOSSLESS, Encoding::UNCOMPRESSED, tiles] {
        let crop = [0., 0., 0., 0., 0., 1., 2., 0., 0., 0., 0., 0.];
        assert_eq!(placed((11, 21), (2, 1), encoding).unwrap(), crop);
        let upper = [1., 2., 3., 4., 5., 6., 7., 8., 0., 0., 0., 0.];
        assert_eq!(placed((10, 20), (4, 2), encoding).unwrap(), upper);
        // Overscan on all sides: 8 x 7 about it.
        let overscan = placed((8, 18), (8, 7), encoding).unwrap();
        assert_eq!(overscan, [19., 20., 21., 22., 27., 28., 29., 30., 35., 36., 37., 38.]);
        // Overlaps at a corner.
        let corner = [4., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0.];
        assert_eq!(placed((9, 19), (2, 2), encoding).unwrap(), corner);
        for outside in [(14, 20), (10, 23), (8, 20), (10, 18)] {
            let error = placed(outside, (2, 2), encoding).unwrap_err().to_string();
            assert!(error.contains("outside of its display window"), "{error}");
        }
    }
}

#[test]
fn colours_are_converted_from_the_primaries_of_the_file() {
    let one = |value| FlatSamples::F32(vec![value]);
    let picture = |chromaticities| {
        let layer = part(
            "a",
            (1, 1),
            Encoding::FAST_LOSSLESS,
            channels(&[("R", one(1.0)), ("G", one(0.5)), ("B", one(0.25))]),
        );
        let attributes = ImageAttributes {
            chromaticities: Some(chromaticities),
            ..ImageAttributes::new(IntegerBounds::from_dimensions((1, 1)))
        };
        let mut frame = Frame::default();
        read_bytes(&bytes_with(attributes, vec![layer]), &mut frame).map(|_| frame.pixels)
    };
    let rec_709 = Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.3, 0.6),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.329),
    };
    assert_eq!(picture(rec_709).unwrap(), Pixels::Radiance(vec![1.0, 0.5, 0.25]), "not touched");
    let xyz = Chromaticities {
        red: Vec2(1.0, 0.0),
        green: Vec2(0.0, 1.0),
        blue: Vec2(0.0, 0.0),
        white: Vec2(1.0 / 3.0, 1.0 / 3.0),
    };
    let Pixels::Radiance(found) = picture(xyz).unwrap() else { panic!("codes") };
    // By the published inverse of the matrix of sRGB.
    for (found, expected) in found.iter().zip([2.3473, -0.0209, 0.2179]) {
        assert!((found - expected).abs() < 2e-3, "{found} {expected}");
    }
    let error = picture(Chromaticities { white: Vec2(0.3, 0.0), ..rec_709 }).unwrap_err().to_string();
    assert!(error.contains("chromaticities") && error.contains("y = 0"), "{error}");
}

#[test]
fn the_only_layer_is_the_picture_and_several_are_named() {
    let layer = |names: &[&str]| {
        let channels: Vec<(String, FlatSamples)> = names
            .iter()
            .flat_map(|name| ["R", "G", "B"].map(|colour| (format!("{name}.{colour}"), floats(1, 3.0))))
            .chain([("Depth.Z".to_owned(), floats(1, 0.0))])
            .collect();
        let mut list: Vec<(&str, FlatSamples)> =
            channels.iter().map(|(name, samples)| (name.as_str(), samples.clone())).collect();
        list.sort_by_key(|(name, _)| *name);
        bytes(vec![part("a", (1, 1), Encoding::FAST_LOSSLESS, super::tests::channels(&list))])
    };
    let mut frame = Frame::default();
    read_bytes(&layer(&["ViewLayer.Combined"]), &mut frame).unwrap();
    assert_eq!(frame.pixels, Pixels::Radiance(vec![3.0; 3]));
    let said = refusal(&layer(&["beauty", "diffuse"]));
    assert!(said.contains("beauty, diffuse"), "{said}");
}

#[test]
fn environment_attribute_moves_the_centres_and_cubes_are_refused() {
    let mut layer = part("a", (2, 12), Encoding::FAST_LOSSLESS, channels(&[("Y", floats(24, 0.0))]));
    layer.attributes.environment_map = Some(EnvironmentMap::LatitudeLongitude);
    layer.attributes.frames_per_second = Some((0, 1));
    let attributes = read_bytes(&bytes(vec![layer.clone()]), &mut Frame::default()).unwrap();
    let expected = Attributes { latlong_centres: LatLongCentres::Ends, ..Attributes::default() };
    assert_eq!(attributes, expected, "a rate of 0/1 is no rate");
    layer.attributes.environment_map = Some(EnvironmentMap::Cube);
    layer.attributes.frames_per_second = Some((24, 0));
    assert!(refusal(&bytes(vec![layer])).contains("cube map"));
}

#[test]
fn wrong_channel_sets_luminance_chroma_and_deep_files_are_refused_by_name() {
    let file = |list: &[(&str, FlatSamples)]| {
        bytes(vec![part("a", (4, 2), Encoding::FAST_LOSSLESS, channels(list))])
    };
    let some = || floats(8, 0.0);
    let error = refusal(&file(&[("R", some()), ("G", some()), ("Z", some())]));
    assert!(error.starts_with("has the channels G, R, Z; R, G and B, or Y,"), "{error}");
    let chroma = file(&[("Y", some()), ("RY", some()), ("BY", some())]);
    assert!(refusal(&chroma).contains("luminance and chroma"));
    // `exr` does not write subsampled channels, so one is made by hand: the name is followed by type,
    // linearity and sampling.
    let mut quarter = chroma.clone();
    let name = chroma.windows(4).position(|window| window == b"RY\0\x02").expect("a float channel");
    (quarter[name + 11], quarter[name + 15]) = (2, 2);
    let error = refusal(&quarter);
    assert!(error.contains("subsampled channels (BY, RY, Y)"), "{error}");

    let flat = file(&[("Y", some())]);
    let deep = replaced(&flat, b"string\0\x0a\0\0\0tiledimage", b"string\0\x08\0\0\0deeptile");
    let deep = replaced(&deep, b"v/1\x01\x02\x02\0\0", b"v/1\x01\x02\x08\0\0");
    assert!(refusal(&deep).contains("deep data"), "{}", refusal(&deep));
}

#[test]
fn truncated_and_absurd_files_say_so() {
    let file =
        bytes(vec![part("a", (40, 40), Encoding::FAST_LOSSLESS, channels(&[("Y", floats(1600, 0.0))]))]);
    for length in [3, 8, 40, 200, 400, file.len() - 1] {
        let error = refusal(&file[..length]);
        assert!(error.contains("complete?") || error.contains("truncated"), "{length} bytes: {error}");
    }
    // Data window from (0, 0) to (39, 39): it is made 2^20 wide, or 16384 high in a file of a few kB.
    let window = b"dataWindow\0box2i\0\x10\0\0\0\0\0\0\0\0\0\0\0\x27\0\0\0\x27\0\0\0";
    let wide = b"dataWindow\0box2i\0\x10\0\0\0\0\0\0\0\0\0\0\0\xff\xff\x0f\0\x27\0\0\0";
    let high = b"dataWindow\0box2i\0\x10\0\0\0\0\0\0\0\0\0\0\0\x27\0\0\0\xff\x3f\0\0";
    assert!(refusal(&replaced(&file, window, wide)).contains("1048576 x 40"));
    let error = refusal(&replaced(&file, window, high));
    assert!(error.contains("damaged") || error.contains("complete?"), "{error}");
}

#[test]
fn block_that_comes_twice_is_damage_and_not_an_old_frame_shining_through() {
    let encoding = Encoding {
        compression: Compression::Uncompressed,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let file = bytes(vec![part("a", (3, 2), encoding, channels(&[("Y", floats(6, 0.0))]))]);
    // Two blocks of 8 + 12 bytes end the file, preceded by the table of two offsets.
    let table = file.len() - 2 * 20 - 16;
    let mut doubled = file.clone();
    doubled.copy_within(table..table + 8, table + 8);
    assert!(refusal(&doubled).contains("unexpected block at pixel (0, 0)"));
    assert!(read_bytes(&file, &mut Frame::default()).is_ok());
}

#[test]
fn dwa_counters_beyond_reason_are_refused_before_they_are_believed() {
    let encoding = Encoding {
        compression: Compression::DWAA(None),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let halves = FlatSamples::F16((0..4096).map(|n| f16::from_f32((n % 61) as f32)).collect());
    let file = bytes(vec![part("a", (64, 64), encoding, channels(&[("Y", halves)]))]);
    assert!(read_bytes(&file, &mut Frame::default()).is_ok());
    // The block starts with y = 0, its size, and version 2 as the first counter; the count of AC values is
    // the ninth.
    let version = [2_u8, 0, 0, 0, 0, 0, 0, 0];
    let start = file.windows(8).rposition(|window| window == version).expect("a DWA block");
    let mut absurd = file.clone();
    absurd[start + 8 * 8 + 5] = 1; // 2^40 values
    assert!(refusal(&absurd).contains("DWA block"), "{}", refusal(&absurd));
}

#[test]
fn dwa_tiles_that_are_cut_and_stored_raw_are_read() {
    // Noise does not compress: the tiles are stored as they are, those at the edges with fewer bytes.
    let noise = |n: u32| f16::from_f32((n.wrapping_mul(2_654_435_761) >> 24) as f32);
    let values: Vec<f16> = (0..48 * 40).map(noise).collect();
    let encoding = Encoding {
        compression: Compression::DWAB(None),
        blocks: Blocks::Tiles(Vec2(16, 16)),
        line_order: LineOrder::Increasing,
    };
    let file = bytes(vec![part("a", (48, 40), encoding, channels(&[("Y", FlatSamples::F16(values))]))]);
    let mut frame = Frame::default();
    read_bytes(&file, &mut frame).unwrap();
    assert_eq!((frame.width, frame.height), (48, 40));
}

#[test]
fn reading_again_keeps_the_buffer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let file =
        |n| bytes(vec![part("a", (n, 2), Encoding::FAST_LOSSLESS, channels(&[("Y", floats(2 * n, 0.0))]))]);
    let mut frame = Frame::default();
    std::fs::write(&path, file(40)).unwrap();
    read(&path, &mut frame).unwrap();
    let address = |frame: &Frame| match &frame.pixels {
        Pixels::Radiance(values) => values.as_ptr(),
        Pixels::Codes(_) => panic!("codes"),
    };
    let before = address(&frame);
    std::fs::write(&path, file(30)).unwrap();
    read(&path, &mut frame).unwrap();
    assert_eq!(address(&frame), before);
    assert_eq!(frame.pixels, Pixels::Radiance((0..60).map(|n| n as f32).collect()));
}
