// From the histogram of a picture to its exposure: log-average, key (Reinhard 2003) and white, smoothed over
// time in stops. CPU twin: render::view::exposure::twin::adapt.

const BINS = 1024u;
const LEAST_STOP = -24.0;
const STOPS = 48.0;
// The darkest and the brightest hundredth of the pixels do not count as the ends of the range.
const TAIL = 0.01;

struct Adaptation {
    // How far the state moves towards the new picture, 0 to 1.
    rate: f32,
}

// In stops; `started` is 0 before the first picture.
struct Exposure {
    log_average: f32,
    log_key: f32,
    log_white: f32,
    started: u32,
}

@group(0) @binding(0) var<uniform> adaptation: Adaptation;
@group(0) @binding(1) var<storage, read_write> bins: array<u32, BINS>;
@group(0) @binding(2) var<storage, read_write> exposure: Exposure;

fn stop_of(bin: u32) -> f32 {
    return LEAST_STOP + (f32(bin) + 0.5) * (STOPS / f32(BINS));
}

@compute @workgroup_size(1)
fn main() {
    var count = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        count += bins[bin];
    }
    if count == 0u {
        return; // a black picture changes nothing
    }
    var mean = 0.0;
    var darkest = LEAST_STOP;
    var brightest = LEAST_STOP;
    var below = 0u;
    let dark_count = u32(TAIL * f32(count));
    let bright_count = count - dark_count;
    for (var bin = 0u; bin < BINS; bin++) {
        let stop = stop_of(bin);
        mean += stop * (f32(bins[bin]) / f32(count));
        if below <= dark_count {
            darkest = stop;
        }
        if below < bright_count {
            brightest = stop;
        }
        below += bins[bin];
        bins[bin] = 0u;
    }
    let range = max(brightest - darkest, 1e-3);
    let key = log2(0.18) + 2.0 * clamp((2.0 * mean - darkest - brightest) / range, -1.0, 1.0);
    if exposure.started == 0u {
        exposure = Exposure(mean, key, brightest, 1u);
        return;
    }
    exposure.log_average += adaptation.rate * (mean - exposure.log_average);
    exposure.log_key += adaptation.rate * (key - exposure.log_key);
    exposure.log_white += adaptation.rate * (brightest - exposure.log_white);
}
