//! Numbers in 16 bits: quantities on a logarithmic scale, directions on the octahedron (ARCHITECTURE.md, "The protocol").

/// Steps of the scale that double a quantity.
const STEPS: f64 = 1024.0;
/// The code of the scale's top.
const TOP: f64 = 65535.0;
/// Half of the codes' range: what a coordinate of 1 is away from the middle.
const HALF: f64 = 32767.5;

/// A scale from 0 to `top`, which has the code 65,535.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    top: f64,
    log_top: f64,
}

impl Scale {
    /// `top` is finite and not negative. Under a `top` of 0 all is 0.
    pub fn new(top: f64) -> Self {
        Self { top, log_top: top.log2() }
    }

    /// The nearest code, by ratio; 0 for what is below the smallest code by more than half a step, for what is negative,
    /// and for NaN. What is above `top` gets the code of `top`.
    pub fn encode(self, value: f32) -> u16 {
        // The cast saturates.
        if value > 0.0 && self.top > 0.0 {
            (TOP + STEPS * (f64::from(value).log2() - self.log_top)).round() as u16
        } else {
            0
        }
    }

    /// What a code stands for: 0 to `top`.
    pub fn decode(self, code: u16) -> f32 {
        if code == 0 { 0.0 } else { (self.top * ((f64::from(code) - TOP) / STEPS).exp2()) as f32 }
    }
}

/// Codes `[u, v]` of a direction, which need not have length 1; straight up where it is none: zero, or not finite.
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
    // The sum of the three coordinates' sizes is 1, so that their length is at least 1 / sqrt(3).
    let scale = 1.0 / (a * a + y * y + b * b).sqrt();
    [a, y, b].map(|v| (v * scale) as f32)
}

/// Turns the four corners of the square in, or out: they are the half of the octahedron that looks down.
fn folded(a: f64, b: f64) -> (f64, f64) {
    let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
    ((1.0 - b.abs()) * sign(a), (1.0 - a.abs()) * sign(b))
}
