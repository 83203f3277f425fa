// Counts the pixels of a picture by the logarithm of their luminance. CPU twin:
// render::view::exposure::twin::histogram.

const BINS = 1024u;
// Stops that the bins cover: 2^-24 to 2^24 times the unit of radiance.
const LEAST_STOP = -24.0;
const STOPS = 48.0;
const LANES = 256u;
const PIXELS_PER_LANE = 16u;

@group(0) @binding(0) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> bins: array<atomic<u32>, BINS>;

var<workgroup> counts: array<atomic<u32>, BINS>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = (group.y * groups.x + group.x) * LANES * PIXELS_PER_LANE;
    for (var i = 0u; i < PIXELS_PER_LANE; i++) {
        let index = first + i * LANES + lane;
        if index < arrayLength(&radiance) {
            let pixel = radiance[index];
            let luminance = dot(pixel.rgb, vec3f(0.2126, 0.7152, 0.0722));
            // Pixels that show nothing, or a black surface, do not count for the exposure.
            if pixel.a > 0.0 && luminance > 0.0 {
                let place = (log2(luminance / pixel.a) - LEAST_STOP) * (f32(BINS) / STOPS);
                atomicAdd(&counts[u32(clamp(place, 0.0, f32(BINS) - 1.0))], 1u);
            }
        }
    }
    workgroupBarrier();
    for (var bin = lane; bin < BINS; bin += LANES) {
        let count = atomicLoad(&counts[bin]);
        if count > 0u {
            atomicAdd(&bins[bin], count);
        }
    }
}
