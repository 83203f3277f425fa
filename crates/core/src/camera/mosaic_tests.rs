//! Mosaics through lens and polar map: constants, power, and the positions of the colours.

use super::energy_tests::{frame, lens, pixel_solid_angle};
use super::{
    ColourMatrix, FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response, ResponseModel,
};
use crate::image::{Bayer, Frame, LatLongCentres, Pixels, PolarMap, PolarShape};
use crate::math::angle_between;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

const PATTERNS: [Bayer; 4] = [Bayer::Rggb, Bayer::Grbg, Bayer::Gbrg, Bayer::Bggr];

/// A 16-bit linear sensor: code n has the radiance n / 4096, black is 0.
fn linear() -> Response {
    let model = ResponseModel::Linear { black_level: 0, white_level: 65_535, gain: 1.0 / 4096.0 };
    Response::new(model).unwrap()
}

/// A lens of 180 degrees with r = theta.
fn equidistant(side: usize) -> Lens {
    let f = 0.5 * side as f64 / FRAC_PI_2;
    Lens::new(LensParameters {
        width: side,
        height: side,
        fx: f,
        fy: f,
        cx: 0.5 * side as f64,
        cy: 0.5 * side as f64,
        k: [0.0; 4],
        field_of_view_rad: PI,
    })
    .unwrap()
}

fn channel_of(bayer: Bayer, [x, y]: [usize; 2]) -> usize {
    bayer.channels()[y % 2 * 2 + x % 2]
}

/// The codes of a mosaic whose pixels see `code` of their channel and position.
fn mosaic(lens: &Lens, bayer: Bayer, code: impl Fn(usize, [usize; 2]) -> u16) -> Frame {
    let (width, height) = (lens.parameters().width, lens.parameters().height);
    let codes = (0..width * height).map(|index| {
        let pixel = [index % width, index / width];
        code(channel_of(bayer, pixel), pixel)
    });
    let codes = Pixels::Codes(codes.collect());
    Frame { bayer: Some(bayer), ..frame(width, height, 1, codes) }
}

/// The same with all three colours in every pixel.
fn full_colour(lens: &Lens, code: impl Fn(usize, [usize; 2]) -> u16) -> Frame {
    let (width, height) = (lens.parameters().width, lens.parameters().height);
    let codes = (0..3 * width * height).map(|index| {
        let (pixel, channel) = (index / 3, index % 3);
        code(channel, [pixel % width, pixel / width])
    });
    frame(width, height, 3, Pixels::Codes(codes.collect()))
}

fn of_mosaic(lens: &Lens, bayer: Bayer, rotation: DMat3, shape: PolarShape) -> FrameToPolar {
    FrameToPolar::mosaic(&Projection::Fisheye(*lens), bayer, rotation, shape).unwrap()
}

fn apply(matrix: &mut FrameToPolar, frame: &Frame) -> PolarMap {
    let mut map = PolarMap::black(matrix.shape());
    matrix.apply(frame, &linear(), &mut map).unwrap();
    assert_eq!(map.stamp, frame.stamp);
    map
}

fn tilted() -> DMat3 {
    DMat3::from_rotation_x(0.4) * DMat3::from_rotation_y(2.1) * LOOKING_UP
}

#[test]
fn a_constant_of_each_colour_stays_that_constant() {
    let codes = [2 * 4096, 3 * 4096 + 5, 777];
    // The circle is not cut at the left and right, but at the top and bottom.
    let lens = lens(254, 190, 180.0);
    let lens = Lens::new(LensParameters { fx: 70.0, fy: 70.0, ..*lens.parameters() }).unwrap();
    for bayer in PATTERNS {
        for (rotation, shape) in
            [(LOOKING_UP, PolarShape::hemisphere(360, 90)), (tilted(), PolarShape::sphere(40, 20))]
        {
            let mut matrix = of_mosaic(&lens, bayer, rotation, shape);
            let map = apply(&mut matrix, &mosaic(&lens, bayer, |channel, _| codes[channel]));
            let mut seen = 0;
            for (pixel, coverage) in map.pixels.iter().zip(matrix.coverage()) {
                for (value, code) in pixel.iter().zip(codes) {
                    let expected = f32::from(code) / 4096.0;
                    // Nothing is made up where the frame sees less.
                    assert!(*value <= expected * (1.0 + 1e-5), "{bayer}: {value} above {expected}");
                    if *coverage > 1.0 - 1e-6 {
                        assert!((value / expected - 1.0).abs() < 1e-5, "{bayer}: {value} not {expected}");
                        seen += 1;
                    }
                    // Also where the border of the frame or the rim of the lens cuts a map pixel.
                    let part = (value / expected - coverage).abs();
                    assert!(part < 2e-4, "{bayer}: {value} of {expected}, {coverage} seen");
                }
            }
            assert!(seen > shape.len(), "{seen} values of whole map pixels");
        }
    }
}

#[test]
fn a_lit_pixel_has_the_power_of_four_pixels_about_its_centre_in_its_own_colour() {
    let lens = lens(254, 190, 220.0);
    let whole = *lens.parameters();
    // After a shift by half a pixel, the area of four pixels about a pixel is that of the pixel and its next
    // neighbours.
    let moved = Lens::new(LensParameters { cx: whole.cx + 0.5, cy: whole.cy + 0.5, ..whole }).unwrap();
    let mut worst: f64 = 0.0;
    for bayer in PATTERNS {
        for rotation in [LOOKING_UP, tilted()] {
            let mut matrix = of_mosaic(&lens, bayer, rotation, PolarShape::sphere(90, 45));
            for [x, y] in [[100, 60], [61, 100], [140, 51], [123, 123], [60, 60], [61, 60], [126, 91]] {
                let map =
                    apply(&mut matrix, &mosaic(&lens, bayer, |_, at| if at == [x, y] { 40_960 } else { 0 }));
                let lit = channel_of(bayer, [x, y]);
                let share = if lit == 1 { 0.5 } else { 1.0 };
                let solid_angle_sr: f64 = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]]
                    .into_iter()
                    .map(|pixel| pixel_solid_angle(&moved, pixel, 16, |_| true))
                    .sum();
                for (channel, power) in map.power().into_iter().enumerate() {
                    if channel == lit {
                        worst = worst.max((power / (10.0 * share * solid_angle_sr) - 1.0).abs());
                    } else {
                        assert_eq!(power, 0.0, "{bayer}: channel {channel} of a pixel of channel {lit}");
                    }
                }
            }
        }
    }
    println!("power of a lit pixel within {worst:.1e}");
    // Four edges of 3e-5 each (`footprints`).
    assert!(worst < 1.2e-4, "{worst:e}");
}

#[test]
fn a_smooth_scene_is_that_of_a_frame_with_all_colours() {
    let lens = equidistant(512);
    let shape = PolarShape::hemisphere(72, 18);
    // Radiances that change by at most 1 per radian in every direction.
    let response = linear();
    let slopes = [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, -1.0, 0.0)];
    let code = |channel: usize, [x, y]: [usize; 2]| {
        let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        // Positions beyond the rim count as on it.
        let at = lens.normalized(centre);
        let ray = lens.unproject_normalized(at, &mut (0.25 * PI));
        response.encode((2.0 + slopes[channel].dot(ray)) as f32)
    };
    let mut matrix = FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).unwrap();
    let expected = apply(&mut matrix, &full_colour(&lens, code));
    // A pixel is represented by its centre, which is off by at most the distance to its corner: 1.5 pixels
    // along both sides in a mosaic (at the border of the frame, 1 elsewhere), 0.5 otherwise. A step of one
    // pixel turns the ray by at most 1 / f. A code is rounded by at most a half.
    let bound = (1.5 + 0.5) * 2f64.sqrt() / lens.parameters().fx + 1.0 / 4096.0;
    for bayer in PATTERNS {
        let map = apply(&mut of_mosaic(&lens, bayer, LOOKING_UP, shape), &mosaic(&lens, bayer, code));
        let differences = map.pixels.iter().flatten().zip(expected.pixels.iter().flatten());
        let worst = differences.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
        let power = [0, 1, 2].map(|channel| map.power()[channel] / expected.power()[channel] - 1.0);
        println!("{bayer}: within {worst:.1e} of the full-colour map (bound {bound:.1e}), power {power:?}");
        assert!(worst < bound, "{bayer}: {worst:e}");
    }
}

#[test]
fn a_picture_of_one_colour_leaves_the_others_black() {
    let lens = lens(128, 96, 180.0);
    for bayer in PATTERNS {
        let mut matrix = of_mosaic(&lens, bayer, LOOKING_UP, PolarShape::hemisphere(36, 9));
        for lit in 0..3 {
            let map =
                apply(&mut matrix, &mosaic(&lens, bayer, |channel, _| if channel == lit { 4096 } else { 0 }));
            for (channel, power) in map.power().into_iter().enumerate() {
                assert!(if channel == lit { power > 6.0 } else { power == 0.0 }, "{bayer} {lit}: {power}");
            }
        }
    }
}

#[test]
fn a_small_disc_stands_in_one_direction_in_all_colours() {
    let lens = equidistant(512);
    let pixel_rad = 1.0 / lens.parameters().fx;
    let shape = PolarShape::hemisphere(1440, 360);
    let (mut between, mut off): (f64, f64) = (0.0, 0.0);
    for bayer in PATTERNS {
        let mut matrix = of_mosaic(&lens, bayer, LOOKING_UP, shape);
        for centre in [(180.0, 200.0), (333.5, 200.5), (180.3, 341.9), (341.75, 320.25)] {
            let centre = DVec2::from(centre);
            // A soft disc with a radius of 8 pixels: the centroid of its samples, every second pixel, is
            // accurate to 0.0013 pixels (a sum over the samples alone, without lens and map); that of a hard
            // disc is not.
            let disc = |_, [x, y]: [usize; 2]| {
                let away = (DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - centre).length() / 8.0;
                if away < 1.0 { (15_000.0 * (1.0 + (PI * away).cos()).powi(2)) as u16 } else { 0 }
            };
            let map = apply(&mut matrix, &mosaic(&lens, bayer, disc));
            let mut sums = [DVec3::ZERO; 3];
            for (cell, pixel) in map.pixels.iter().enumerate() {
                let (row, column) = (cell / shape.columns(), cell % shape.columns());
                let towards = shape.pixel_direction(row, column) * shape.pixel_solid_angle(row);
                for channel in 0..3 {
                    sums[channel] += towards * f64::from(pixel[channel]);
                }
            }
            let expected = LOOKING_UP * lens.unproject(centre).unwrap();
            for channel in 0..3 {
                between = between.max(angle_between(sums[channel], sums[(channel + 1) % 3]) / pixel_rad);
                off = off.max(angle_between(sums[channel], expected) / pixel_rad);
            }
        }
    }
    println!("disc: colours within {between:.4} px of each other, within {off:.4} px of its centre");
    // Pixels that begin with the mosaic's period put red and blue 2^0.5 pixels from each other.
    assert!(between < 0.01, "{between} px");
    // The solid angle of a pixel falls from the inner to the outer side of the disc, which pulls its mean
    // inwards.
    assert!(off < 0.02, "{off} px");
}

#[test]
fn every_pixel_is_used_and_counted_once() {
    // The field of view reaches beyond the corners.
    let lens = Lens::new(LensParameters { fx: 60.0, fy: 60.0, ..*lens(254, 190, 180.0).parameters() });
    let lens =
        Lens::new(LensParameters { field_of_view_rad: 5.6, k: [0.0; 4], ..*lens.unwrap().parameters() });
    let lens = lens.unwrap();
    let codes = |_, [x, y]: [usize; 2]| match (x * 31 + y * 17) % 5 {
        0 => 0,
        1 => 65_535,
        code => 4096 * code as u16,
    };
    let count = |code: u16| {
        let Pixels::Codes(all) = mosaic(&lens, Bayer::Grbg, codes).pixels else { panic!("codes were made") };
        all.into_iter().filter(|other| *other == code).count() as u64
    };
    for bayer in PATTERNS {
        let mut matrix = of_mosaic(&lens, bayer, tilted(), PolarShape::sphere(40, 20));
        let mut map = PolarMap::black(matrix.shape());
        let counts = matrix.apply(&mosaic(&lens, bayer, codes), &linear(), &mut map).unwrap();
        assert_eq!((counts.saturated, counts.black_clipped), (count(65_535), count(0)));
    }
}

#[test]
fn colours_of_the_sensor_become_rec_709_in_mosaics_and_whole_frames() {
    let lens = lens(128, 96, 180.0);
    let shape = PolarShape::hemisphere(36, 9);
    let matrix = ColourMatrix::new([[2.0, -0.5, 0.0], [0.25, 1.0, 0.0], [-1.0, -1.0, 1.5]]).unwrap();
    // The colour (1, 2, 1.5) becomes (1, 2.25, -0.75), whose last component is below zero.
    let code = |channel: usize, _| [4096, 8192, 6144][channel];
    let whole = FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).unwrap();
    let frames = [(whole, full_colour(&lens, code))].into_iter().chain(
        PATTERNS.map(|bayer| (of_mosaic(&lens, bayer, LOOKING_UP, shape), mosaic(&lens, bayer, code))),
    );
    for (frame_to_polar, frame) in frames {
        let map = apply(&mut frame_to_polar.with_colours(matrix), &frame);
        // Far from the rim.
        for pixel in &map.pixels[..7 * 36] {
            assert!((pixel[0] - 1.0).abs() < 2e-5 && (pixel[1] - 2.25).abs() < 2e-5, "{pixel:?}");
            assert_eq!(pixel[2], 0.0);
        }
    }
}

#[test]
fn frames_and_calibrations_that_do_not_fit_are_named() {
    let lens = lens(128, 96, 180.0);
    let shape = PolarShape::hemisphere(36, 9);
    let message = |mut matrix: FrameToPolar, frame: &Frame| {
        let error = matrix.apply(frame, &linear(), &mut PolarMap::black(shape)).unwrap_err();
        assert_eq!(error.kind(), crate::error::Kind::BadFrame);
        error.to_string()
    };
    let whole = FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).unwrap();
    let rggb = of_mosaic(&lens, Bayer::Rggb, LOOKING_UP, shape);
    let grey = frame(128, 96, 1, Pixels::Codes(vec![9; 128 * 96]));
    let of = |bayer| Frame { bayer: Some(bayer), ..grey.clone() };
    let found = message(whole.clone(), &of(Bayer::Bggr));
    assert!(found.contains("a mosaic of colours BGGR") && found.contains("for no mosaic"), "{found}");
    let found = message(rggb.clone(), &of(Bayer::Grbg));
    assert!(
        found.contains("a mosaic of colours GRBG") && found.contains("for a mosaic of colours RGGB"),
        "{found}"
    );
    let found = message(rggb.clone(), &grey);
    assert!(found.contains("is no mosaic with 1 channels, its calibration is for a mosaic of"), "{found}");
    let three = Pixels::Codes(vec![9; 3 * 128 * 96]);
    let found = message(rggb.clone(), &Frame { channels: 3, pixels: three, ..of(Bayer::Rggb) });
    assert!(found.contains("with 3 channels") && found.contains("RGGB with 1 channel"), "{found}");
    let radiance = Pixels::Radiance(vec![1.0; 128 * 96]);
    let found = message(rggb.clone(), &Frame { pixels: radiance, ..of(Bayer::Rggb) });
    assert!(found.contains("must hold the sensor's raw codes"), "{found}");
    let identity = ColourMatrix::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).unwrap();
    let found = message(whole.with_colours(identity), &grey);
    assert!(found.contains("no colours") && found.contains("rec709_from_sensor"), "{found}");

    let refused = |projection: Projection| {
        let error = FrameToPolar::mosaic(&projection, Bayer::Rggb, LOOKING_UP, shape).unwrap_err();
        assert_eq!(error.kind(), crate::error::Kind::Usage);
        error.to_string()
    };
    for (width, height, place) in [(127, 96, "width = 127: "), (128, 95, "height = 95: ")] {
        let odd = Lens::new(LensParameters { width, height, ..*lens.parameters() }).unwrap();
        let found = refused(Projection::Fisheye(odd));
        assert!(found.starts_with(place) && found.contains("even columns and rows"), "{found}");
    }
    let centres = LatLongCentres::Half;
    let found = refused(Projection::LatLong { width: 128, height: 64, centres });
    assert!(found.starts_with("projection: a lat-long panorama is no mosaic"), "{found}");
}
