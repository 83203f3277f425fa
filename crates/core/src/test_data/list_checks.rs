use crate::image::{PolarMap, luminance_f64};
use crate::light::{Light, LightList};

/// Checks everything that holds for every list.
pub fn check_list(case: &str, list: &LightList, count: usize) {
    assert_eq!(list.lights.len(), count, "{case}");
    for (slot, Light { id, direction, irradiance, spread_rad }) in list.lights.iter().enumerate() {
        assert_eq!(*id as usize, slot, "{case}");
        let length = direction.iter().map(|d| d * d).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-6, "{case}: {direction:?}");
        assert!(irradiance.iter().all(|v| v.is_finite() && *v >= 0.0), "{case}: {irradiance:?}");
        assert!((0.0..=std::f32::consts::FRAC_PI_2).contains(spread_rad), "{case}: {spread_rad}");
    }
    let error = list.error.unwrap();
    assert!(error >= 0.0 && error.is_finite(), "{case}: error {error}");
    assert_eq!(list.prefix_errors.last(), Some(&(count as u32, error)), "{case}");
}

/// Checks that a list of one of the hard maps is complete and has the map's power.
pub fn check_hard(case: &str, name: &str, map: &PolarMap, list: &LightList, count: usize) {
    if name == "largest values" {
        // Irradiances are held at f32::MAX: only finiteness can be checked.
        assert!(list.lights.iter().flat_map(|l| l.irradiance).all(f32::is_finite), "{case}");
        return;
    }
    check_list(case, list, count);
    let (power, expected) = (luminance_f64(list.power), luminance_f64(map.power()));
    // Below 1e-38 f32 has fewer digits.
    let tolerance = if name == "tiny values" { 0.05 } else { 1e-4 };
    assert!((power - expected).abs() <= tolerance * expected, "{case}: {power} {expected}");
}

/// Checks that no light has power and that their directions are uniform over the hemisphere: cos theta has
/// mean 1/2, the horizontal components cancel.
pub fn check_dark(case: &str, list: &LightList, tolerance: [f32; 3]) {
    assert!(list.lights.iter().all(|l| l.irradiance == [0.0; 3] && l.spread_rad == 0.0), "{case}");
    assert_eq!(list.power, [0.0; 3], "{case}");
    for axis in 0..3 {
        let mean = list.lights.iter().map(|l| l.direction[axis]).sum::<f32>() / list.lights.len() as f32;
        let expected = if axis == 1 { 0.5 } else { 0.0 };
        assert!((mean - expected).abs() < tolerance[axis], "{case} {axis}: {mean}");
    }
}
