use super::integrate::FrameView;
use super::*;
use crate::calibrate::Calibration;
use crate::error::{Error, Kind, TomlText};
use crate::files::read;
use lightcast_core::camera::{FrameToPolar, Response};
use lightcast_core::image::{PolarMap, PolarShape};
use lightcast_core::test_data::real_folder;
use std::path::{Path, PathBuf};

const SKY: &str = "
name = 'sky.###.png'
frames = 3
frame_rate_hz = 20.0
first_number = 7
cells_per_pixel = 2
noise = { seed = 1, photon_radiance = 1e-3, read_codes = 0.7 }
[fisheye]
width = 24
height = 20
field_of_view_deg = 180.0
response = { model = 'logarithmic', a = 1500.0, b = 200.0, black_clip_code = 5, saturation_code = 4095 }
[sky.sun]
radiance = [1e5, 1e5, 1e5]
path = [{ time_s = 0.0, azimuth_deg = 10.0, elevation_deg = 50.0 }]
[sky.clouds]
cover = 0.4
radiance = [1.0, 1.0, 1.0]
[[sky.lamp]]
azimuth_deg = 100.0
elevation_deg = 20.0
radius_deg = 4.0
radiance = [9.0, 5.0, 1.0]
flicker = { frequency_hz = 3.0, depth = 0.5 }
";

fn parse(text: &str) -> Result<Script> {
    Script::parse(&TomlText { path: "a/sky.toml".into(), text: text.to_owned() }, None)
}

fn refusal(text: &str) -> String {
    let error: Error = parse(text).unwrap_err();
    assert_eq!(error.kind(), Kind::Usage);
    error.to_string()
}

fn frames(script: &Script) -> Vec<Frame> {
    let mut source = Synthetic::new(script.clone());
    let mut all = Vec::new();
    let mut frame = Frame::default();
    while source.next(&mut frame).unwrap() == Next::Frame {
        all.push(frame.clone());
    }
    assert_eq!(source.next(&mut frame).unwrap(), Next::End);
    all
}

fn replay(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("replay").join(name)
}

fn data() -> Option<PathBuf> {
    real_folder("env").and_then(|folder| folder.parent().map(Path::to_path_buf))
}

#[test]
fn one_script_gives_the_same_frames_in_every_order() {
    let script = parse(SKY).unwrap();
    let all = frames(&script);
    assert_eq!(all.len(), 3);
    let mut again = Synthetic::new(script);
    let mut frame = Frame::default();
    for index in [2, 0, 1] {
        again.render(index, &mut frame);
        assert!(frame == all[index], "{index}");
    }
    assert_ne!(all[0].pixels, all[1].pixels);
    let stamp = all[2].stamp;
    assert_eq!((stamp.sequence, stamp.capture_time_ns, stamp.frame_rate_hz), (9, 100_000_000, 20.0));
    assert_eq!((frame.width, frame.height, frame.channels), (24, 20, 3));
    assert_eq!(again.script().name.file(2), "sky.009.png");
}

#[test]
fn codes_are_the_response_of_the_radiance() {
    let quiet = SKY.replace("noise = ", "# ");
    let codes = frames(&parse(&quiet).unwrap());
    let linear = quiet.replace(".png", ".exr").replace("response = ", "# ");
    let radiance = frames(&parse(&linear).unwrap());
    let (Pixels::Codes(codes), Pixels::Radiance(radiance)) = (&codes[1].pixels, &radiance[1].pixels) else {
        panic!("codes and radiance")
    };
    let response = parse(SKY).unwrap().response;
    assert!(codes.iter().zip(radiance).all(|(code, radiance)| response.encode(*radiance) == *code));
    assert!(codes.iter().any(|code| *code > 2500), "the sun is there");
    // Half a stop less is the same factor everywhere, and the luminance frames match the colour frames.
    let darker = frames(&parse(&format!("exposure = [{{ time_s = 0.0, stops = -0.5 }}]\n{linear}")).unwrap());
    let grey = frames(&parse(&format!("colour = false\n{linear}")).unwrap());
    let (Pixels::Radiance(darker), Pixels::Radiance(grey)) = (&darker[1].pixels, &grey[1].pixels) else {
        panic!("radiance")
    };
    for (pixel, (dark, grey)) in radiance.chunks_exact(3).zip(darker.chunks_exact(3).zip(grey)) {
        assert!((dark[2] - pixel[2] * 0.5f32.sqrt()).abs() <= 1e-6 * pixel[2]);
        assert_eq!(*grey, luminance([pixel[0], pixel[1], pixel[2]]));
    }
}

#[test]
fn faults_are_named_with_file_line_and_key() {
    assert!(refusal("name = 'a").starts_with("a/sky.toml: line 1 (`name = 'a`): "));
    let message = refusal(&SKY.replace("cover", "covers"));
    assert!(message.starts_with("a/sky.toml: line 17 (") && message.contains("`covers`"), "{message}");
    let message = refusal(&SKY.replace("height = 20", "height = 'x'"));
    assert!(message.starts_with("a/sky.toml: line 10 (") && message.contains("height = 'x'"), "{message}");
    for (from, to, expected) in [
        ("frames = 3", "frames = 0", "line 3: frames: must"),
        ("frame_rate_hz = 20.0", "frame_rate_hz = nan", "line 4: frame_rate_hz: must"),
        ("sky.###.png", "sky.png", "line 2: name: must hold"),
        ("sky.###.png", "sky.###.exr", "line 2: name: must end in .png"),
        ("sky.###.png", "sky.###5.png", "line 2: name: must hold"),
        ("height = 20", "height = 20000", "line 8: fisheye: width and height must"),
        ("cover = 0.4", "cover = 1.4", "line 17: sky.clouds.cover: must"),
        ("radius_deg = 4.0", "radius_deg = 0.0", "line 22: sky.lamp[0].radius_deg: must"),
        ("depth = 0.5", "depth = 1.5", "line 24: sky.lamp[0].flicker: needs"),
        ("depth = 0.5", "depth = 0.5, phase_turns = 1e300", "line 24: sky.lamp[0].flicker: needs"),
        ("path = [{ time_s = 0.0", "path = [{ time_s = -inf", "line 15: sky.sun.path[0].time_s: must"),
        ("[9.0, 5.0, 1.0]", "[9.0, 5.0, -1.0]", "line 23: sky.lamp[0].radiance: must"),
        ("elevation_deg = 50.0", "elevation_deg = 95.0", "line 15: sky.sun.path[0]: needs"),
        (
            "field_of_view_deg = 180.0",
            "field_of_view_deg = 0.0",
            "line 11: fisheye.field_of_view_deg = 0: must",
        ),
        ("[fisheye]", "[fisheye]\nfocal_px = -1.0", "line 9: fisheye.focal_px = -1: must be positive"),
        ("b = 200.0", "b = 0.0", "line 12: fisheye.response.b = 0: must be "),
        ("[fisheye]", "[lat_long]\nwidth = 9\nheight = 9\n[fisheye]", "lat_long or fisheye: one of"),
        ("read_codes = 0.7", "read_codes = -1.0", "line 7: noise: needs"),
    ] {
        let message = refusal(&SKY.replace(from, to));
        assert!(message.contains(expected), "{message}");
    }
    assert!(refusal(&SKY[..SKY.find("[sky.sun]").unwrap()]).contains("sky, room or panorama: one of"));
}

#[test]
fn a_panorama_that_is_not_there_is_named_with_what_to_do() {
    let text = |file: &str| {
        format!(
            "name = 'a.#.exr'\nframes = 1\nframe_rate_hz = 25.0\nlat_long = {{ width = 8, height = 4 }}\n\
             [panorama]\nfile = '{file}'\n"
        )
    };
    let message = refusal(&text("data:env/x.hdr"));
    assert!(
        message.starts_with("a/sky.toml: line 6: panorama.file") && message.contains("LIGHTCAST_DATA"),
        "{message}"
    );
    let message = refusal(&text("x.hdr"));
    assert!(
        message.starts_with("a/sky.toml: line 6: panorama.file") && message.contains("a/x.hdr"),
        "{message}"
    );
}

#[test]
fn lamps_of_the_room_switch_when_they_should() {
    let script = Script::load(&replay("room.toml"), None).unwrap();
    let mut source = Synthetic::new(script);
    let mut frame = Frame::default();
    let mut brightest = |index| {
        source.render(index, &mut frame);
        let Pixels::Radiance(samples) = &frame.pixels else { panic!("radiance") };
        let channel = |channel| samples.iter().skip(channel).step_by(3).copied().fold(0.0, f32::max);
        (channel(0), channel(2), samples.iter().map(|v| f64::from(*v)).sum::<f64>())
    };
    let (tube, dark, blue, late) = (brightest(0), brightest(16), brightest(22), brightest(45));
    // Frame 15 is 0.6 s: the tube goes off; frame 20 is 0.8 s: the blue lamp goes on.
    assert!(tube.2 > 1.2 * dark.2, "{tube:?} {dark:?}");
    assert!(blue.1 > 50.0 && blue.2 > dark.2, "{blue:?}");
    // One stop less, with the tube and the blue lamp on.
    assert!((late.1 / blue.1 - 0.5).abs() < 0.2 && late.0 > 20.0, "{late:?}");
}

#[test]
fn garden_turns_a_column_a_frame_and_hall_flickers_where_it_should() {
    let Some(data) = data() else { return };
    let load = |name: &str| Script::load(&replay(name), Some(&data)).unwrap();
    let radiance = |source: &mut Synthetic, index: usize| {
        let mut frame = Frame::default();
        source.render(index, &mut frame);
        let Pixels::Radiance(samples) = frame.pixels else { panic!("radiance") };
        samples
    };
    let mut garden = Synthetic::new(load("garden.toml"));
    assert_eq!(garden.script().frames, 40);
    let first = radiance(&mut garden, 0);
    let brightest = (0..360).max_by(|a, b| {
        let power = |column: &usize| -> f64 {
            let pixel = |row: usize| &first[(row * 360 + column) * 3..];
            (0..90)
                .map(|row| {
                    let sine = (std::f64::consts::PI * (row as f64 + 0.5) / 180.0).sin();
                    f64::from(luminance([pixel(row)[0], pixel(row)[1], pixel(row)[2]])) * sine
                })
                .sum()
        };
        power(a).total_cmp(&power(b))
    });
    // phi column 20 is column 110 of the file.
    assert_eq!(brightest, Some(110));
    for t in [1, 21, 39] {
        let turned = radiance(&mut garden, t);
        for (row, line) in turned.chunks_exact(360 * 3).enumerate() {
            for (column, pixel) in line.chunks_exact(3).enumerate() {
                let from = (row * 360 + (column + t) % 360) * 3;
                assert!(pixel == &first[from..from + 3], "{t} {row} {column}");
            }
        }
    }

    let mut hall = Synthetic::new(load("hall.toml"));
    let (steady, t) = (radiance(&mut hall, 0), 3);
    let factor = 1.0 + 0.5 * (std::f64::consts::TAU * 0.38 * t as f64).sin();
    let flickered = radiance(&mut hall, t);
    let mut changed = 0;
    for (index, (before, after)) in steady.chunks_exact(3).zip(flickered.chunks_exact(3)).enumerate() {
        if before == after {
            continue;
        }
        let (row, column) = (index / 360, index % 360);
        assert!(row < 90 && (90 + 71..=90 + 149).contains(&column), "{row} {column}");
        assert!((f64::from(after[0]) / f64::from(before[0]) - factor).abs() < 1e-6);
        changed += 1;
    }
    // 3 % of the whole hemisphere are 972 pixels; most of the bright pixels are lamps on this side.
    assert!((100..=972).contains(&changed), "{changed}");
    println!("{changed} pixels of the hall flicker");
}

#[test]
fn bundled_frames_are_what_their_script_makes() {
    let script = Script::load(&replay("day.toml"), None).unwrap();
    let (name, frames) = (script.name.clone(), script.frames);
    let bundled_camera = Calibration::load(&replay("day/calibration.json"), None).unwrap();
    assert_eq!(script.calibration(), Some(bundled_camera));
    assert!(frames >= 76, "three seconds at 25 Hz");
    let mut source = Synthetic::new(script);
    let (mut made, mut bundled) = (Frame::default(), Frame::default());
    for index in [0, 41, frames - 1] {
        source.render(index, &mut made);
        let path = replay("day").join(name.file(index));
        read(&path, &mut bundled).unwrap();
        assert!(
            made.pixels == bundled.pixels,
            "{} differs; if day.toml was changed on purpose: lightcast synthesize replay/day.toml --output \
             replay/day",
            path.display()
        );
    }
}

#[test]
fn a_moving_sun_keeps_its_power_through_lens_and_polar_map() {
    let text = "
        name = 'sun.#.exr'
        frames = 40
        frame_rate_hz = 25.0
        [fisheye]
        width = 96
        height = 80
        field_of_view_deg = 186.0
        k = [0.012, -0.004, 0.0006, 0.0]
        centre_px = [47.1, 41.3]
        [sky]
        zenith = [0.0, 0.0, 0.0]
        horizon = [0.0, 0.0, 0.0]
        ground = [0.0, 0.0, 0.0]
        [sky.sun]
        radiance = [1e6, 1e6, 1e6]
        path = [{ azimuth_deg = -40.0, elevation_deg = 4.0 }, { time_s = 1.6, azimuth_deg = 200.0, elevation_deg = 90.0 }]
    ";
    let mut source = Synthetic::new(parse(text).unwrap());
    let FrameView { projection, world_from_camera } = source.script().view;
    let shape = PolarShape::hemisphere(360, 90);
    let mut matrix = FrameToPolar::new(&projection, world_from_camera, shape).unwrap();
    let (mut frame, mut map) = (Frame::default(), PolarMap::black(shape));
    // Solid angle of the soft-edged disc: see `Emitter::area`; the angle itself is 0.2666 degrees.
    let radius_rad = 0.2666f64.to_radians();
    let expected = 1e6 * std::f64::consts::PI * radius_rad * radius_rad * (1.0 + 0.15 * 0.15 / 5.0);
    let mut worst: f64 = 0.0;
    while source.next(&mut frame).unwrap() == Next::Frame {
        matrix.apply(&frame, &Response::default(), &mut map).unwrap();
        worst = worst.max((map.power()[0] / expected - 1.0).abs());
    }
    println!("worst relative error of the sun's power in the polar map: {worst:.2e}");
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn a_real_sun_keeps_its_power_through_a_fisheye_too() {
    let Some(data) = data() else { return };
    let text = |see: &str| {
        format!(
            "name = 'garden.#.exr'\nframes = 5\nframe_rate_hz = 25.0\n{see}\n[panorama]\n\
             file = 'data:env/chinese_garden_1k.hdr'\nturn = {{ degrees_per_second = 333.0 }}\n"
        )
    };
    let source = |see: &str| {
        let script = TomlText { path: "garden.toml".into(), text: text(see) };
        let script = Script::parse(&script, Some(&data)).unwrap();
        Synthetic::new(script)
    };
    let mut exact = source("lat_long = { width = 1024, height = 512 }");
    let mut fisheye = source("fisheye = { width = 160, height = 160, field_of_view_deg = 186.0 }");
    let shape = PolarShape::hemisphere(360, 90);
    let (mut frame, mut map) = (Frame::default(), PolarMap::black(shape));
    let mut powers = |source: &mut Synthetic| -> Vec<f64> {
        let FrameView { projection, world_from_camera } = source.script().view;
        let mut matrix = FrameToPolar::new(&projection, world_from_camera, shape).unwrap();
        let mut power = |index| {
            source.render(index, &mut frame);
            matrix.apply(&frame, &Response::default(), &mut map).unwrap();
            map.power()[1]
        };
        (0..5).map(&mut power).collect()
    };
    let (exact, fisheye) = (powers(&mut exact), powers(&mut fisheye));
    let worst = exact.iter().zip(&fisheye).map(|(a, b)| (b / a - 1.0).abs()).fold(0.0, f64::max);
    println!("worst relative difference of the garden's power: {worst:.2e}");
    assert!(worst < 1e-3, "{exact:?} {fisheye:?}");
}
