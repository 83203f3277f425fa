// Distributes lights to angular regions, one workgroup per region, in the order of the list (Havran et al.
// 2005, section 4.1). CPU twin: light::Regions::assign.

struct Assignment {
    // Lights first_light .. first_light + light_count of the buffer; their indices count from first_light.
    first_light: u32,
    light_count: u32,
    // Lights that a region can hold, and the word of `lists` at which the first region starts.
    capacity: u32,
    first_word: u32,
}

struct Light {
    direction: vec3f,
    spread_rad: f32,
    irradiance: vec3f,
    tile: u32,
}

const LANES = 64u;

@group(0) @binding(0) var<uniform> assignment: Assignment;
@group(0) @binding(1) var<storage, read> lights: array<Light>;
// Direction of a region's centre, and the least dot product with it of the lights that belong to the region.
@group(0) @binding(2) var<storage, read> caps: array<vec4f>;
// For every region: number of lights held, the factor for their power, and their indices.
@group(0) @binding(3) var<storage, read_write> lists: array<u32>;

var<workgroup> ranks: array<u32, 64>;
var<workgroup> sums: array<vec2f, 64>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let cap = caps[group.x];
    let start = assignment.first_word + group.x * (assignment.capacity + 2u);
    var held = 0u;
    // Luminance of the lights within the region, and of those that fitted into its list.
    var sum = vec2f(0.0);
    for (var base = 0u; base < assignment.light_count; base += LANES) {
        let number = base + lane;
        var luminance = 0.0;
        var belongs = false;
        if number < assignment.light_count {
            let light = lights[assignment.first_light + number];
            luminance = dot(light.irradiance, vec3f(0.2126, 0.7152, 0.0722));
            belongs = dot(light.direction, cap.xyz) >= cap.w && any(light.irradiance > vec3f(0.0));
        }
        // Inclusive prefix sum of the lanes that hold a light: their positions in the list.
        ranks[lane] = u32(belongs);
        workgroupBarrier();
        for (var step = 1u; step < LANES; step *= 2u) {
            var left = 0u;
            if lane >= step {
                left = ranks[lane - step];
            }
            workgroupBarrier();
            ranks[lane] += left;
            workgroupBarrier();
        }
        if belongs {
            let place = held + ranks[lane] - 1u;
            sum.x += luminance;
            if place < assignment.capacity {
                sum.y += luminance;
                lists[start + 2u + place] = number;
            }
        }
        held += ranks[LANES - 1u];
        workgroupBarrier();
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var step = LANES / 2u; step > 0u; step /= 2u) {
        if lane < step {
            sums[lane] += sums[lane + step];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        let all = sums[0];
        lists[start] = min(held, assignment.capacity);
        lists[start + 1u] = bitcast<u32>(select(1.0, min(all.x / all.y, 3.4e38), held > assignment.capacity && all.y > 0.0));
    }
}
