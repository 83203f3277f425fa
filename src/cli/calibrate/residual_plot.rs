use crate::calibrate::LensFit;
use crate::picture::{Panel, Plot, Series};

/// Bins of angle from the axis to the widest corner.
const BINS: usize = 18;

/// Residuals of a fit against the angle from the axis, and of the pictures by their number. A lens that the
/// model does not fit shows as a mean away from the axis, or as an RMS that grows with the angle.
pub(super) fn residual_plot(fit: &LensFit) -> Plot {
    let mut bins = vec![Bin::default(); BINS];
    for residual in &fit.residuals {
        let share = residual.theta_rad / fit.theta_max_rad.max(f64::MIN_POSITIVE);
        let bin = &mut bins[((share * BINS as f64) as usize).min(BINS - 1)];
        bin.count += 1.0;
        bin.sum += residual.radial_px;
        bin.radial_squares += residual.radial_px.powi(2);
        bin.across_squares += residual.across_px.powi(2);
        bin.largest = bin.largest.max(residual.radial_px.hypot(residual.across_px));
    }
    let width_deg = fit.theta_max_rad.to_degrees() / BINS as f64;
    // Bins without corners have no value: 0 / 0 has no place on the axes and interrupts the line.
    let by_angle = |name: &str, value: fn(&Bin) -> f64| Series {
        name: name.to_owned(),
        points: bins
            .iter()
            .enumerate()
            .map(|(at, bin)| ((at as f64 + 0.5) * width_deg, value(bin)))
            .collect(),
    };
    let pictures = |name: &str, is_dropped: bool| Series {
        name: name.to_owned(),
        points: fit
            .views
            .iter()
            .enumerate()
            .filter(|(_, view)| view.dropped.is_some() == is_dropped)
            // Dots, not a line, because neighbouring pictures are unrelated.
            .flat_map(|(at, view)| [((at + 1) as f64, view.rms_px.unwrap_or(f64::NAN)), (f64::NAN, f64::NAN)])
            .collect(),
    };
    Plot {
        title: format!(
            "Residuals of {} corners: RMS {:.3} px, up to {:.1} degrees from the axis",
            fit.residuals.len(),
            fit.rms_px,
            fit.theta_max_rad.to_degrees()
        ),
        panels: vec![
            Panel {
                title: "By field angle".to_owned(),
                x_label: "angle from the axis / degrees".to_owned(),
                y_label: "residual / px".to_owned(),
                series: vec![
                    by_angle("RMS away from the axis", |bin| (bin.radial_squares / bin.count).sqrt()),
                    by_angle("RMS across", |bin| (bin.across_squares / bin.count).sqrt()),
                    by_angle("mean away from the axis, absolute", |bin| (bin.sum / bin.count).abs()),
                    by_angle("largest", |bin| bin.largest),
                ],
                ..Panel::default()
            },
            Panel {
                title: "By picture".to_owned(),
                x_label: "number of the picture".to_owned(),
                y_label: "residual / px".to_owned(),
                series: vec![pictures("RMS of a picture", false), pictures("RMS of a dropped picture", true)],
                ..Panel::default()
            },
        ],
    }
}

#[derive(Clone, Debug, Default)]
struct Bin {
    count: f64,
    sum: f64,
    radial_squares: f64,
    across_squares: f64,
    largest: f64,
}
