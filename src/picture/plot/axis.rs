//! A logarithmic axis: its range, where values fall on it, and its ticks.

/// Narrowest range that is drawn, as a ratio: a single value is in the middle of an octave.
const NARROWEST: f64 = 2.0;
/// Margin at either end, as a fraction of the range's logarithm.
const MARGIN: f64 = 0.04;
/// Desired number of labelled ticks, if there are as many.
const WANTED_LABELS: usize = 3;
/// Most labels that a panel has room for.
const MOST_LABELS: usize = 8;
/// Space that a label takes along the axis.
const LABEL_PX: f64 = 31.0;

/// A logarithmic axis from one position in px to another, in either direction.
pub struct Axis {
    /// Natural logarithms of the ends.
    low: f64,
    high: f64,
    from_px: f64,
    to_px: f64,
}

/// A line across the panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// A small integer times a power of ten.
    pub value: f64,
    /// Whether it is labelled with the value.
    pub is_labelled: bool,
}

impl Axis {
    /// An axis that contains all `values`, which are positive and finite; from 1 to 10 if there are none.
    pub fn new(values: impl Iterator<Item = f64>, from_px: f64, to_px: f64) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            (low, high) = (low.min(value.ln()), high.max(value.ln()));
        }
        if low > high {
            (low, high) = (0.0, 10.0f64.ln());
        }
        let widening = ((NARROWEST.ln() - (high - low)) / 2.0).max(MARGIN * (high - low));
        Self { low: low - widening, high: high + widening, from_px, to_px }
    }

    /// The positions that it goes from and to.
    pub fn ends_px(&self) -> (f64, f64) {
        (self.from_px, self.to_px)
    }

    /// Position of a positive value.
    pub fn position(&self, value: f64) -> f64 {
        self.from_px + (value.ln() - self.low) / (self.high - self.low) * (self.to_px - self.from_px)
    }

    /// Ticks at 1 to 9 times the powers of ten; only at the powers where the range is long. Labels are at the
    /// powers, or also at 2 and 5, or at all ticks, so that there are enough of them; where there are too
    /// many, only at every second, third, ... power. Labels never touch each other.
    pub fn ticks(&self) -> Vec<Tick> {
        const LN_10: f64 = std::f64::consts::LN_10;
        let decades = (self.low / LN_10).floor() as i32..=(self.high / LN_10).ceil() as i32;
        let is_inside = |value: f64| value > 0.0 && (self.low..=self.high).contains(&value.ln());
        let at = |digits: &[u32]| -> usize {
            let values = decades.clone().flat_map(|decade| digits.iter().map(move |&digit| (digit, decade)));
            values.filter(|&(digit, decade)| is_inside(power(digit, decade))).count()
        };
        let powers = at(&[1]);
        let (digits, every) = if powers >= WANTED_LABELS {
            ([1].as_slice(), powers.div_ceil(MOST_LABELS) as i32)
        } else if at(&[1, 2, 5]) >= WANTED_LABELS {
            ([1, 2, 5].as_slice(), 1)
        } else {
            ([1, 2, 3, 4, 5, 6, 7, 8, 9].as_slice(), 1)
        };
        let minor = if powers > MOST_LABELS { 1..=1 } else { 1..=9 };
        let (mut ticks, of_ticks): (Vec<Tick>, Vec<u32>) = decades
            .flat_map(|decade| minor.clone().map(move |digit| (digit, decade)))
            .map(|(digit, decade)| {
                let is_labelled = digits.contains(&digit) && decade % every == 0;
                (Tick { value: power(digit, decade), is_labelled }, digit)
            })
            .filter(|(tick, _)| is_inside(tick.value))
            .unzip();
        // The roundest values come first; a tick whose label would touch one of theirs gets none.
        let mut taken: Vec<f64> = Vec::new();
        for digit in [1, 5, 2, 3, 4, 7, 6, 8, 9] {
            for (tick, _) in
                ticks.iter_mut().zip(&of_ticks).filter(|(tick, of)| tick.is_labelled && **of == digit)
            {
                let place = self.position(tick.value);
                tick.is_labelled = taken.iter().all(|other| (place - other).abs() >= LABEL_PX);
                if tick.is_labelled {
                    taken.push(place);
                }
            }
        }
        ticks
    }
}

/// digit * 10^decade, as exact as the parsed decimal literal.
fn power(digit: u32, decade: i32) -> f64 {
    format!("{digit}e{decade}").parse().unwrap_or(0.0)
}

/// A tick's value: plain from 0.001 to 9999, else as 2e-5.
pub fn tick_label(value: f64) -> String {
    if (0.001..1e4).contains(&value) { format!("{value}") } else { format!("{value:e}") }
}
