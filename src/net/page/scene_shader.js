// Shaders of the scene. For every light and every point they compute the part of the light that the scene's
// objects hide. These are a sphere, a ball, a box and a stick, for which the distance of a ray is known
// exactly, so that shadows are as soft as the light is spread and have no noise.

/**
 * Objects of the scene; lengths in the scene's own units. The colours are albedos, linear Rec. 709. The
 * rounded lower edges of the box are below the ground.
 */
export const THINGS = {
  sphere: { centre: [-0.88, 0.72, 0.05], radius: 0.72, colour: [0.78, 0.76, 0.72], metal: 0, roughness: 0.55 },
  ball: { centre: [0.22, 0.31, 0.98], radius: 0.31, colour: [0.95, 0.79, 0.55], metal: 1, roughness: 0.36 },
  box: { centre: [0.86, 0.46, -0.35], half: [0.5, 0.54, 0.5], turn: 0.55, rounding: 0.05, colour: [0.55, 0.19, 0.1], metal: 0, roughness: 0.5 },
  stick: { from: [1.3, 0, 0.8], length: 1.15, radius: 0.04, colour: [0.7, 0.7, 0.7], metal: 0, roughness: 0.5 },
};
export const GROUND = { radius: 8, colour: [0.42, 0.43, 0.45], metal: 0, roughness: 1 };

/** The object that a surface belongs to, so that it does not shadow itself. */
export const SELF = { ground: 0, sphere: 1, ball: 2, box: 3, stick: 4 };

export const VERTEX = `#version 300 es
uniform mat4 camera;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
out vec3 point;
out vec3 facing;
void main() {
  point = position;
  facing = normal;
  gl_Position = camera * vec4(position, 1.0);
}`;

const number = (value) => value.toFixed(6);
const vec3 = (values) => `vec3(${values.map(number).join(", ")})`;
const { sphere, ball, box, stick } = THINGS;

/** For at most `most` lights. */
export const fragment = (most) => `#version 300 es
precision highp float;
precision highp int;
layout(std140) uniform Lights {
  vec4 direction_radius[${most}];
  vec4 irradiance_sine[${most}];
};
uniform int count;
uniform int self;
uniform vec3 eye;
uniform vec3 albedo;
uniform float metal;
uniform float roughness;
uniform vec3 from_ground;
uniform vec3 background;
uniform float exposure;
in vec3 point;
in vec3 facing;
out vec4 colour;

const float PI = 3.14159265;

// The part of a disc of angular radius r on one side of a line at the signed distance s from its centre.
float cut(float s, float r) {
  return smoothstep(-r, r, s);
}

// The part of a light of angular radius r in direction l that a sphere hides. Angles are approximated by
// their tangents: here, the distance by which the ray misses the sphere, divided by the distance to there.
float by_sphere(vec3 centre, float radius, vec3 l, float r) {
  vec3 to = centre - point;
  float along = dot(to, l);
  if (along <= 0.0) return 0.0;
  float far2 = dot(to, to);
  float apart = sqrt(max(far2 - along * along, 0.0));
  // A sphere that looks smaller than the light cannot hide all of it.
  return min(1.0, radius * radius / (far2 * r * r)) * cut((radius - apart) / along, r);
}

// The part that a vertical capsule hides, by the closest approach of the ray to its axis.
float by_stick(vec3 l, float r) {
  vec3 to = ${vec3(stick.from)} - point;
  float flat_part = max(1.0 - l.y * l.y, 1e-4);
  float height = clamp((l.y * dot(to, l) - to.y) / flat_part, 0.0, ${number(stick.length)});
  vec3 nearest = to + vec3(0.0, height, 0.0);
  float along = dot(nearest, l);
  if (along <= 0.0) return 0.0;
  float apart = length(nearest - along * l) / along;
  float size = ${number(stick.radius)} / along;
  // A strip across the disc of the light.
  return cut(apart + size, r) - cut(apart - size, r);
}

// The part that a box hides: the ray is inside between the last of the three planes through which it enters
// and the first of the three through which it leaves. For one of each, the distance between them along the
// ray is negative for a ray that misses their edge; it gives the distance of the ray from the edge's line,
// and the point there. The smallest of the six angles counts.
float by_box(vec3 l, float r) {
  const float c = ${number(Math.cos(box.turn))};
  const float s = ${number(Math.sin(box.turn))};
  vec3 o = point - ${vec3(box.centre)};
  o = vec3(c * o.x - s * o.z, o.y, s * o.x + c * o.z);
  vec3 d = vec3(c * l.x - s * l.z, l.y, s * l.x + c * l.z);
  if (self == ${SELF.ground}) {
    // At the foot of the box the centre of a pixel may be under it, but the visible surface is beside it.
    vec2 under = ${vec3(box.half)}.xz - abs(o.xz);
    if (under.x > 0.0 && under.y > 0.0) {
      if (under.x < under.y) o.x += sign(o.x) * (under.x + 1e-3);
      else o.z += sign(o.z) * (under.y + 1e-3);
    }
  }
  d = mix(d, vec3(1e-4), lessThan(abs(d), vec3(1e-4)));
  vec3 middle = -o / d;
  vec3 span = ${vec3(box.half)} / abs(d);
  vec3 enter = middle - span;
  vec3 leave = middle + span;
  float last = min(min(leave.x, leave.y), leave.z);
  // The box is behind: the backward half of the ray is inside.
  if (last <= 0.0 && max(max(enter.x, enter.y), enter.z) <= last) return 0.0;
  // The pairs y and z, z and x, x and y of the planes' directions, with the ray entering by one and leaving
  // by the other, and vice versa.
  vec3 one = (d * d).yzx;
  vec3 other = (d * d).zxy;
  vec3 both = one + other;
  vec3 sideways = sqrt(one * other / both);
  vec3 a = (leave.zxy - enter.yzx) * sideways / max((enter.yzx * one + leave.zxy * other) / both, 1e-4);
  vec3 b = (leave.yzx - enter.zxy) * sideways / max((enter.zxy * other + leave.yzx * one) / both, 1e-4);
  vec3 least = min(a, b);
  return cut(min(min(least.x, least.y), least.z), r);
}

float lit(vec3 l, float r) {
  float part = 1.0;
  if (self != ${SELF.sphere}) part *= 1.0 - by_sphere(${vec3(sphere.centre)}, ${number(sphere.radius)}, l, r);
  if (self != ${SELF.ball}) part *= 1.0 - by_sphere(${vec3(ball.centre)}, ${number(ball.radius)}, l, r);
  if (self != ${SELF.box}) part *= 1.0 - by_box(l, r);
  if (self != ${SELF.stick}) part *= 1.0 - by_stick(l, r);
  return part;
}

float noise(vec2 at) {
  return fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715))));
}

void main() {
  vec3 n = normalize(facing);
  vec3 v = normalize(eye - point);
  float nv = max(dot(n, v), 1e-3);
  vec3 f0 = mix(vec3(0.04), albedo, metal);
  vec3 diffuse = vec3(0.0);
  vec3 mirrored = vec3(0.0);
  for (int i = 0; i < count; i++) {
    vec3 l = direction_radius[i].xyz;
    float r = direction_radius[i].w;
    float sine = irradiance_sine[i].w;
    // Cosine of a light that is partly behind the surface.
    float nl = dot(n, l);
    nl = nl > sine ? nl : nl < -sine ? 0.0 : (nl + sine) * (nl + sine) / (4.0 * sine);
    if (nl <= 0.0) continue;
    vec3 e = irradiance_sine[i].rgb * (nl * lit(l, r));
    diffuse += e;
    if (self == ${SELF.ground}) continue;
    // GGX, widened by the extent of the light.
    vec3 h = normalize(l + v);
    float a = min(roughness * roughness + 0.35 * r, 1.0);
    float nh = max(dot(n, h), 0.0);
    float lobe = a / (nh * nh * (a * a - 1.0) + 1.0);
    float k = 0.5 * a;
    float shape = lobe * lobe / (4.0 * PI * (nv * (1.0 - k) + k) * (max(nl, 1e-3) * (1.0 - k) + k));
    float grazing = 1.0 - max(dot(v, h), 0.0);
    float grazing2 = grazing * grazing;
    vec3 fresnel = f0 + (1.0 - f0) * (grazing2 * grazing2 * grazing);
    mirrored += e * shape * fresnel;
  }
  vec3 body = albedo * (1.0 - metal) * 0.96;
  vec3 radiance = body / PI * diffuse + mirrored;
  if (self != ${SELF.ground}) {
    // Light reflected by the ground, less where the object itself shadows it.
    float open = smoothstep(-0.3, 1.3, point.y);
    vec3 back = reflect(-v, n);
    radiance += from_ground * open * (body * (0.5 - 0.5 * n.y) + f0 * smoothstep(0.25, -0.25, back.y));
  }
  radiance *= exposure;
  float bright = dot(radiance, vec3(0.2126, 0.7152, 0.0722));
  // Reinhard's global operator; 6 becomes white.
  radiance *= (1.0 + bright / 36.0) / (1.0 + bright);
  vec3 shown = mix(1.055 * pow(max(radiance, 0.0), vec3(1.0 / 2.4)) - 0.055, 12.92 * radiance, lessThan(radiance, vec3(0.0031308)));
  if (self == ${SELF.ground}) shown = mix(shown, background, smoothstep(1.8, ${number(GROUND.radius)}, length(point.xz)));
  // Half a step of dither against banding.
  colour = vec4(shown + (noise(gl_FragCoord.xy) - 0.5) / 255.0, 1.0);
}`;
