// Reflectance of a surface of a view (view/seen.wgsl). CPU twin: src/render/directional/shade_twin.rs.

const PI = 3.14159265358979;

// GGX (Walter et al. 2007), alpha = roughness^2.
fn ggx_distribution(n_h: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let d = (n_h * a2 - n_h) * n_h + 1.0;
    return a2 / (PI * d * d);
}

// Height-correlated Smith masking over 4 (n.l) (n.v) (Heitz 2014).
fn smith_visibility(n_l: f32, n_v: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let l = n_v * sqrt((n_l - a2 * n_l) * n_l + a2);
    let v = n_l * sqrt((n_v - a2 * n_v) * n_v + a2);
    return 0.5 / max(l + v, 1e-6);
}

// Zero for a light exactly behind the surface that the eye looks at.
fn half_vector(view: vec3f, l: vec3f) -> vec3f {
    let sum = view + l;
    return sum * inverseSqrt(max(dot(sum, sum), 1e-30));
}

// Radiance towards `view` per irradiance of a light from `l`: specular part. `spread_rad` is the RMS angle of
// the radiance that the light stands for: the lobe is widened by it.
fn specular_reflectance(s: Surface, view: vec3f, l: vec3f, spread_rad: f32, energy: f32) -> vec3f {
    if s.gloss < 0.0 {
        // Phong's lobe about the mirrored view, normalised to reflect `specular` at normal incidence
        // (Lafortune and Willems 1994). Its RMS angle is about sqrt(2 / (exponent + 1)); variances add.
        let width = 2.0 / (1.0 - s.gloss) + spread_rad * spread_rad;
        let exponent = max(2.0 / width - 1.0, 0.0);
        let cosine = dot(reflect(-view, s.normal), l);
        // pow(0, 0) is undefined.
        if cosine <= 0.0 {
            return vec3f(0.0);
        }
        return s.specular * ((exponent + 2.0) / (2.0 * PI) * pow(cosine, exponent));
    }
    let h = half_vector(view, l);
    let n_h = clamp(dot(s.normal, h), 0.0, 1.0);
    let n_l = dot(s.normal, l);
    let n_v = max(dot(s.normal, view), 1e-3);
    let v_h = clamp(dot(view, h), 0.0, 1.0);
    let rough = max(s.gloss * s.gloss, 1e-3);
    // The half vector turns by half the angle of the light; a variance twice as large compensates for GGX's
    // narrow core.
    let alpha = min(sqrt(rough * rough + 0.5 * spread_rad * spread_rad), 1.0);
    let fresnel = s.specular + (1.0 - s.specular) * pow(1.0 - v_h, 5.0);
    // Light that leaves the surface after more than one reflection, from the albedo of a single one (Turquin
    // 2019).
    let multiple = 1.0 + s.specular * (1.0 / energy - 1.0);
    return fresnel * multiple * (ggx_distribution(n_h, alpha) * smith_visibility(n_l, n_v, rough));
}

// The same for the diffuse part: Lambert, less the part that a metal-rough surface reflects specularly.
fn diffuse_reflectance(s: Surface, view: vec3f, l: vec3f) -> vec3f {
    var share = vec3f(1.0);
    if s.gloss >= 0.0 {
        let v_h = clamp(dot(view, half_vector(view, l)), 0.0, 1.0);
        share = 1.0 - (s.specular + (1.0 - s.specular) * pow(1.0 - v_h, 5.0));
    }
    return s.diffuse * share / PI;
}
