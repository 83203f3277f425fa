//! The Pareto front: the methods that no other beats in both time and error.

/// For every point (time, error), whether no other point has at most its time and at most its error, and less
/// of one. Equal points are on the front together; the quickest of the points without error is on it too. A
/// point that is not finite is never on the front and never keeps another off it.
pub fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let is_finite = |point: &(f64, f64)| point.0.is_finite() && point.1.is_finite();
    let beats = |other: &(f64, f64), point: &(f64, f64)| {
        other.0 <= point.0 && other.1 <= point.1 && (other.0 < point.0 || other.1 < point.1)
    };
    let is_beaten = |point: &(f64, f64)| points.iter().any(|other| is_finite(other) && beats(other, point));
    points.iter().map(|point| is_finite(point) && !is_beaten(point)).collect()
}

/// A method with some number of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contender<'a> {
    /// The method's name.
    pub method: &'a str,
    /// Number of lights.
    pub lights: usize,
    /// Time in ms.
    pub time_ms: f64,
    /// Error, or another value that is better the smaller it is.
    pub value: f64,
}

/// Says for every number of lights whether `ours` is on the front of `what` among those with as many lights,
/// and where it is not, which methods beat it. `None` when `ours` is not among them.
pub fn finding(what: &str, ours: &str, contenders: &[Contender]) -> Option<String> {
    let (mut on, mut off) = (Vec::new(), Vec::new());
    for own in contenders.iter().filter(|contender| contender.method == ours) {
        let rivals: Vec<&Contender> =
            contenders.iter().filter(|other| other.lights == own.lights && other.method != ours).collect();
        let mut points = vec![(own.time_ms, own.value)];
        points.extend(rivals.iter().map(|rival| (rival.time_ms, rival.value)));
        if front(&points)[0] {
            on.push(own.lights.to_string());
            continue;
        }
        let better = rivals
            .iter()
            .filter(|rival| rival.time_ms <= own.time_ms && rival.value <= own.value)
            .min_by(|a, b| a.value.total_cmp(&b.value));
        off.push(match better {
            Some(Contender { method, time_ms, value, .. }) => format!(
                "{} ({method}: {} in {time_ms:.3} ms against {} in {:.3} ms)",
                own.lights,
                figure(*value),
                figure(own.value),
                own.time_ms
            ),
            None => format!("{} (no finite value)", own.lights),
        });
    }
    match (on.is_empty(), off.is_empty()) {
        (true, true) => None,
        (_, true) => Some(format!("{what}: ours ({ours}) is on the front at every number of lights.")),
        (true, false) => {
            Some(format!("{what}: ours ({ours}) is on the front at no number of lights: {}.", off.join(", ")))
        }
        (false, false) => Some(format!(
            "{what}: ours ({ours}) is on the front at {} lights, not at {}.",
            on.join(", "),
            off.join(", ")
        )),
    }
}

/// A figure as tables show it: five decimals, or two and a power of ten where five would show too little.
pub fn figure(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else if value.abs() >= 1000.0 || value.abs() < 0.001 {
        format!("{value:.2e}")
    } else if value.abs() >= 10.0 {
        format!("{value:.2}")
    } else if value.abs() >= 1.0 {
        format!("{value:.3}")
    } else {
        format!("{value:.5}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_on_the_front_unless_another_is_better() {
        let points = [(1.0, 0.5), (2.0, 0.1), (2.5, 0.1), (0.5, 0.6), (3.0, 0.6)];
        assert_eq!(front(&points), [true, true, false, true, false]);
        assert!(front(&[]).is_empty());
        assert_eq!(front(&[(1.0, 1.0), (1.0, 1.0), (1.0, 2.0)]), [true, true, false]);
    }

    #[test]
    fn the_front_of_zeros_is_the_quickest() {
        assert_eq!(front(&[(1.0, 0.0), (0.5, 0.0), (2.0, 0.0)]), [false, true, false]);
    }

    #[test]
    fn what_is_not_finite_is_off_the_front_and_beats_nothing() {
        let odd = f64::NAN;
        assert_eq!(
            front(&[(odd, 0.0), (1.0, odd), (1.0, 2.0), (0.5, f64::INFINITY)]),
            [false, false, true, false]
        );
        assert_eq!(front(&[(1.0, f64::INFINITY)]), [false]);
    }

    #[test]
    fn findings_name_who_is_better_and_where() {
        let contender = |method, lights, time_ms, value| Contender { method, lights, time_ms, value };
        let mut all = vec![
            contender("refined", 4, 2.0, 0.2),
            contender("median cut", 4, 1.0, 0.1),
            contender("standard", 4, 0.5, 0.15),
            contender("refined", 8, 2.0, 0.01),
            contender("median cut", 8, 1.0, 0.02),
        ];
        let mixed = finding("Shadow", "refined", &all).unwrap();
        assert_eq!(
            mixed,
            "Shadow: ours (refined) is on the front at 8 lights, not at 4 (median cut: 0.10000 in 1.000 ms against \
             0.20000 in 2.000 ms)."
        );
        let all_on = finding("Shadow", "median cut", &all[3..]).unwrap();
        assert!(all_on.ends_with("at every number of lights."), "{all_on}");
        let none = finding("Shadow", "refined", &all[..3]).unwrap();
        assert!(none.contains("at no number of lights: 4 (median cut"), "{none}");
        assert_eq!(finding("Shadow", "paper", &all), None);
        all[3].value = f64::NAN;
        assert!(finding("Shadow", "refined", &all).unwrap().contains("8 (no finite value)"));
    }

    #[test]
    fn figures_have_digits_that_say_something() {
        let written = [0.0, 0.25, 12.346, 1.5, 0.000_123, 1e-9, 54321.0, -0.5].map(figure);
        assert_eq!(written, ["0", "0.25000", "12.35", "1.500", "1.23e-4", "1.00e-9", "5.43e4", "-0.50000"]);
    }
}
