//! Numbers in 16 bits: quantities on a logarithmic scale, directions on the octahedron (`docs/protocol.md`).

/// Steps of the scale that double a quantity.
const STEPS: f64 = 1024.0;
/// The code of the scale's top.
const TOP: f64 = 65535.0;
/// Half of the codes' range: the distance of a coordinate of 1 from the middle.
const HALF: f64 = 32767.5;

/// A scale from 0 to `top`, which has the code 65,535.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    top: f64,
    log_top: f64,
}

impl Scale {
    /// `top` is finite and not negative. With a `top` of 0 everything is 0.
    pub fn new(top: f64) -> Self {
        Self { top, log_top: top.log2() }
    }

    /// The nearest code, by ratio; 0 for values more than half a step below the smallest code, for negative
    /// values, and for NaN. Values above `top` get the code of `top`.
    pub fn encode(self, value: f32) -> u16 {
        // The cast saturates.
        if value > 0.0 && self.top > 0.0 {
            (TOP + STEPS * (f64::from(value).log2() - self.log_top)).round() as u16
        } else {
            0
        }
    }

    /// The value that a code stands for: 0 to `top`.
    pub fn decode(self, code: u16) -> f32 {
        if code == 0 { 0.0 } else { (self.top * ((f64::from(code) - TOP) / STEPS).exp2()) as f32 }
    }
}

/// Codes `[u, v]` of a direction, which need not have length 1; straight up where it is invalid: zero, or not
/// finite.
pub fn encode_direction(direction: [f32; 3]) -> [u16; 2] {
    let [x, y, z] = direction.map(f64::from);
    let length = x.abs() + y.abs() + z.abs();
    let (a, b) = if !(length > 0.0 && length.is_finite()) {
        (0.0, 0.0)
    } else if y < 0.0 {
        folded(x / length, z / length)
    } else {
        (x / length, z / length)
    };
    [a, b].map(|v| ((v + 1.0) * HALF).round() as u16)
}

/// The unit vector that codes stand for; every pair stands for one.
pub fn decode_direction(codes: [u16; 2]) -> [f32; 3] {
    let [a, b] = codes.map(|code| f64::from(code) / HALF - 1.0);
    let y = 1.0 - a.abs() - b.abs();
    let (a, b) = if y < 0.0 { folded(a, b) } else { (a, b) };
    // The sum of the three coordinates' absolute values is 1, so that their length is at least 1 / sqrt(3).
    let scale = 1.0 / (a * a + y * y + b * b).sqrt();
    [a, y, b].map(|v| (v * scale) as f32)
}

/// Folds the four corners of the square in, or out: they are the lower half of the octahedron.
fn folded(a: f64, b: f64) -> (f64, f64) {
    let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
    ((1.0 - b.abs()) * sign(a), (1.0 - a.abs()) * sign(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use lightcast_core::math::{angle_between, direction, fibonacci_sphere};
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Degrees between a direction and its decoded code, which has length 1.
    fn turned_deg(wanted: [f32; 3]) -> f64 {
        let got = DVec3::from(decode_direction(encode_direction(wanted)).map(f64::from));
        assert!((got.length() - 1.0).abs() < 1e-6, "{wanted:?}: {got}");
        angle_between(DVec3::from(wanted.map(f64::from)), got).to_degrees()
    }

    #[test]
    fn directions_turn_by_less_than_the_protocol_says() {
        let all_over = fibonacci_sphere(200_000).map(turned_deg_of).fold(0.0, f64::max);
        // Axes, the edges of the octahedron where its halves meet, and directions close to them on either
        // side.
        let mut hard = 0.0_f64;
        for quarter in 0..4 {
            let phi = f64::from(quarter) * FRAC_PI_2;
            for theta in [0.0, 1e-7, 1e-5, 1e-3, FRAC_PI_2, PI - 1e-3, PI - 1e-5, PI] {
                for (d_theta, d_phi) in [(0.0, 0.0), (1e-6, 1e-6), (-1e-6, -1e-6), (3e-5, -3e-5), (0.0, 0.3)]
                {
                    hard = hard.max(turned_deg_of(direction(theta + d_theta, phi + d_phi)));
                }
            }
        }
        assert!(all_over < 0.004 && hard < 0.004, "{all_over} {hard}");
    }

    fn turned_deg_of(towards: DVec3) -> f64 {
        turned_deg(towards.as_vec3().to_array())
    }

    #[test]
    fn directions_need_no_length_and_what_is_none_is_straight_up() {
        for length in [1e-38_f32, 1e-3, 1e3, 1e38] {
            assert!(turned_deg([0.6 * length, -0.8 * length, 0.1 * length]) < 0.004, "{length}");
        }
        let up = encode_direction([0.0, 1.0, 0.0]);
        for none in [[0.0; 3], [f32::NAN, 1.0, 0.0], [0.0, f32::INFINITY, 1.0], [0.0, 0.0, f32::NEG_INFINITY]]
        {
            assert_eq!(encode_direction(none), up, "{none:?}");
        }
    }

    #[test]
    fn every_code_stands_for_itself() {
        for top in [f64::from(f32::MIN_POSITIVE) * 1e20, 1.0, PI, 1e30] {
            let scale = Scale::new(top);
            let mut last = -1.0;
            for code in 0..=u16::MAX {
                let value = scale.decode(code);
                assert!(value > last && f64::from(value) <= top * (1.0 + 1e-7), "{top} {code}: {value}");
                assert_eq!(scale.encode(value), code, "of {top}: {value}");
                last = value;
            }
        }
        // On the octahedron the edge of the lower half is there twice, and every corner four times.
        for u in (0..=u16::MAX).step_by(257) {
            for v in (0..=u16::MAX).step_by(255) {
                let once = decode_direction([u, v]);
                let twice = decode_direction(encode_direction(once));
                let apart = (0..3).map(|axis| (once[axis] - twice[axis]).abs()).fold(0.0, f32::max);
                assert!(apart < 3e-7, "{u} {v}: {once:?} {twice:?}");
            }
        }
    }

    #[test]
    fn quantities_are_within_a_thousandth_over_twelve_decades_down_to_the_smallest_floats() {
        for top in [1e30_f32, 1.0, 3e-20, 1e-37, 1e-40, 1e-44, f32::from_bits(1)] {
            let scale = Scale::new(f64::from(top));
            assert_eq!(scale.decode(scale.encode(top)), top);
            let mut value = f64::from(top);
            while value > 1e-12 * f64::from(top) {
                let wanted = value as f32;
                let got = scale.decode(scale.encode(wanted));
                assert!(f64::from((got - wanted).abs()) <= 0.001 * f64::from(wanted), "{top} {wanted} {got}");
                value *= 0.999_37;
            }
        }
    }

    #[test]
    fn what_is_out_of_the_scale_is_put_onto_its_ends() {
        let scale = Scale::new(2.0);
        assert_eq!([scale.encode(0.0), scale.encode(-1.0), scale.encode(f32::NAN)], [0; 3]);
        assert_eq!([scale.encode(3.0), scale.encode(f32::INFINITY)], [u16::MAX; 2]);
        let least = scale.decode(1);
        assert!((1e-20..1.2e-19).contains(&least), "{least}");
        assert_eq!([scale.encode(least), scale.encode(0.9999 * least), scale.encode(0.5 * least)], [1, 1, 0]);
        for top in [0.0, -0.0] {
            let dark = Scale::new(top);
            for value in [0.0, 1e-45, 1.0, f32::MAX] {
                assert_eq!(dark.encode(value), 0);
            }
            for code in [0, 1, u16::MAX] {
                assert_eq!(dark.decode(code), 0.0);
            }
        }
    }
}
