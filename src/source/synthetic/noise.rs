//! Repeatable randomness: every value is a hash of its indices, so any frame can be made on its own.

use std::f64::consts::TAU;

/// 64 well-mixed bits of a key: Vigna's SplitMix64 output function.
pub fn hash(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Uniform in [0, 1) from the top 53 bits.
fn uniform(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Two independent standard normal values of a key (Box and Muller 1958).
pub fn normal_pair(key: u64) -> [f64; 2] {
    let bits = hash(key);
    // 1 - u lies in (0, 1], so the logarithm is finite.
    let radius = (-2.0 * (1.0 - uniform(bits)).ln()).sqrt();
    let (sin, cos) = (TAU * uniform(hash(bits))).sin_cos();
    [radius * cos, radius * sin]
}

/// Value noise in the plane: hashed values in [0, 1) on the integer lattice, interpolated by a quintic (the
/// fade of Perlin 2002, whose first two derivatives vanish on the lattice).
pub fn value_noise(x: f64, y: f64, seed: u64) -> f64 {
    let (x0, y0) = (x.floor(), y.floor());
    let fade = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (tx, ty) = (fade(x - x0), fade(y - y0));
    let row = |y: i64| hash(seed ^ hash(y as u64));
    let corner = |row: u64, x: i64| uniform(hash(row ^ x as u64));
    let (i, j) = (x0 as i64, y0 as i64);
    let (row_0, row_1) = (row(j), row(j + 1));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    mix(mix(corner(row_0, i), corner(row_0, i + 1), tx), mix(corner(row_1, i), corner(row_1, i + 1), tx), ty)
}

/// Sum of five octaves of value noise, each half as strong and twice as fine as the one before, scaled to [0,
/// 1). Finer octaves drift `shift` faster, so that the pattern changes while it moves.
pub fn fractal_noise(x: f64, y: f64, shift: [f64; 2], seed: u64) -> f64 {
    let (mut sum, mut weight, mut scale) = (0.0, 0.5, 1.0);
    for octave in 0..5u32 {
        let speed = 1.0 + 0.35 * f64::from(octave);
        let (x, y) = ((x + shift[0] * speed) * scale, (y + shift[1] * speed) * scale);
        sum += weight * value_noise(x, y, seed.wrapping_add(u64::from(octave)));
        weight *= 0.5;
        scale *= 2.03; // not 2: coinciding lattices would be visible
    }
    sum / (1.0 - 1.0 / 32.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitmix_matches_its_published_first_output() {
        // Seed 1234567, first output of Vigna's reference implementation.
        assert_eq!(hash(1_234_567), 6_457_827_717_110_365_317);
    }

    #[test]
    fn normal_values_have_their_moments() {
        let n = 100_000u64;
        let values: Vec<f64> = (0..n).flat_map(normal_pair).collect();
        let moment = |power: i32| values.iter().map(|v| v.powi(power)).sum::<f64>() / values.len() as f64;
        // The bounds are four standard errors: 1, sqrt 2 and sqrt 96 over the root of 200,000.
        assert!(moment(1).abs() < 0.009);
        assert!((moment(2) - 1.0).abs() < 0.013);
        assert!((moment(4) - 3.0).abs() < 0.09);
    }

    #[test]
    fn value_noise_is_continuous_and_in_range() {
        for i in -500..500 {
            let (x, y) = (f64::from(i) * 0.037, f64::from(i) * -0.0213);
            let value = value_noise(x, y, 7);
            assert!((0.0..1.0).contains(&value));
            assert!((value_noise(x + 1e-9, y, 7) - value).abs() < 1e-8);
            assert!((0.0..1.0).contains(&fractal_noise(x, y, [3.0, 4.0], 7)));
        }
        assert_ne!(value_noise(0.3, 0.4, 7), value_noise(0.3, 0.4, 8));
    }
}
