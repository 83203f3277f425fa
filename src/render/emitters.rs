use lightcast_core::image::PolarMap;
use lightcast_core::light::Light;

/// A light for every pixel of a map that has power, which together light a reference picture.
pub fn emitters(map: &PolarMap) -> Vec<Light> {
    let columns = map.shape.columns();
    let lit = map.pixels.iter().enumerate().filter(|(_, pixel)| pixel.iter().any(|&v| v > 0.0));
    lit.map(|(index, pixel)| {
        let (row, column) = (index / columns, index % columns);
        let solid_angle = map.shape.pixel_solid_angle(row);
        Light {
            id: index as u32,
            direction: map.shape.pixel_direction(row, column).as_vec3().to_array(),
            irradiance: pixel.map(|radiance| (f64::from(radiance) * solid_angle) as f32),
            // The spread of a pixel is neglected, since its neighbours are lights too.
            spread_rad: 0.0,
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::PolarShape;

    #[test]
    fn emitters_have_the_power_of_the_map() {
        let map = PolarMap::from_fn(PolarShape::hemisphere(36, 9), |row, column| {
            if row == 3 { [0.0; 3] } else { [row as f32, column as f32, 1.0] }
        });
        let lights = emitters(&map);
        assert_eq!(lights.len(), 8 * 36);
        for channel in 0..3 {
            let sum: f64 = lights.iter().map(|light| f64::from(light.irradiance[channel])).sum();
            assert!((sum / map.power()[channel] - 1.0).abs() < 1e-6);
        }
        assert_eq!(lights[40].direction, map.shape.pixel_direction(1, 4).as_vec3().to_array());
    }
}
