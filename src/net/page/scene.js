// A small scene, lit by the lights as they arrive.

import { firstLights } from "/first_lights.js";
import { fit, luminance, program } from "/gl.js";
import { capsule, ground, roundedBox } from "/meshes.js";
import { GROUND, SELF, THINGS, VERTEX, fragment } from "/scene_shader.js";

/** Most lights that illuminate the scene; the others join them. */
const MOST_LIGHTS = 64;
/**
 * Smallest angular radius of a light: it limits the sharpness of shadows, so that their edges do not flicker.
 */
const LEAST_RADIUS_RAD = 0.006;
const BACKGROUND = [0x17, 0x1a, 0x1f].map((code) => code / 255);
/** Brightness of the ground that the exposure aims at, and the time constant of its adaptation. */
const KEY = 0.42;
const ADAPTATION_S = 1.2;
/**
 * Quality levels of pictures: resolution along an edge relative to the screen's, and number of lights. A
 * picture that takes too long makes the next ones coarser; many that take less make them finer.
 */
const QUALITIES = [[1, 64], [0.8, 64], [0.65, 64], [0.5, 64], [0.5, 32], [0.5, 16], [0.4, 16], [0.4, 8]];
const FIRST_QUALITY = 3;
const SLOW_MS = 45;
const FAST_MS = 25;
const FAST_IN_A_ROW = 40;

export class Scene {
  #canvas;
  #gl;
  #draw = null;
  #buffer = null;
  #parts = [];
  #lights = new Float32Array(8 * MOST_LIGHTS);
  #count = 0;
  #fromGround = [0, 0, 0];
  #exposure = null;
  #adapted_ms = 0;
  #fence = null;
  #fenced_ms = 0;
  #quality = FIRST_QUALITY;
  #fast = 0;
  /**
   * How many pictures have to be fast before a finer level is tried; more after that has turned out too slow.
   */
  #patience = 3;
  #list = [];
  #rest_ms = 0;
  #stale = true;
  #azimuth = Math.PI / 2 + 0.35;
  #elevation = 0.42;
  #turned;

  /** `turned(azimuth)` is called with the azimuth of the viewing direction. */
  constructor(canvas, turned) {
    this.#canvas = canvas;
    this.#turned = turned;
    // Without a GPU there is no antialiasing, which is three times as fast.
    this.#gl = canvas.getContext("webgl2", { antialias: true, alpha: false, failIfMajorPerformanceCaveat: true });
    if (this.#gl === null) {
      this.#quality = QUALITIES.length - 1;
      this.#gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
    }
    if (this.#gl === null) return;
    this.#build();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.#build());
    this.#listen();
  }

  /** Whether the browser can draw it. */
  get works() {
    return this.#gl !== null;
  }

  #build() {
    const gl = this.#gl;
    this.#fence = null;
    this.#draw = program(gl, VERTEX, fragment(MOST_LIGHTS));
    gl.uniformBlockBinding(this.#draw.program, gl.getUniformBlockIndex(this.#draw.program, "Lights"), 0);
    this.#buffer = gl.createBuffer();
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.#buffer);
    gl.bufferData(gl.UNIFORM_BUFFER, this.#lights, gl.DYNAMIC_DRAW);
    const { sphere, ball, box, stick } = THINGS;
    // The ground last: most of it is behind the others.
    this.#parts = [
      this.#part(SELF.sphere, sphere, capsule(sphere.centre, 0, sphere.radius, 64)),
      this.#part(SELF.ball, ball, capsule(ball.centre, 0, ball.radius, 48)),
      this.#part(SELF.box, box, roundedBox(box.centre, box.half, box.turn, box.rounding)),
      this.#part(SELF.stick, stick, capsule(stick.from, stick.length, stick.radius, 16)),
      this.#part(SELF.ground, GROUND, ground(GROUND.radius)),
    ];
    gl.enable(gl.DEPTH_TEST);
    this.#stale = true;
  }

  #part(self, material, { vertices, indices }) {
    const gl = this.#gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(vertices), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(indices), gl.STATIC_DRAW);
    for (const place of [0, 1]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 24, 12 * place);
    }
    return { self, material, array, count: indices.length };
  }

  #listen() {
    const canvas = this.#canvas;
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (last === null) return;
      this.#turn((event.clientX - last[0]) * 0.008, (event.clientY - last[1]) * 0.006);
      last = [event.clientX, event.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (last = null));
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.05], ArrowDown: [0, -0.05] }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      this.#turn(...step);
    });
    this.#turn(0, 0);
  }

  #turn(azimuth, elevation) {
    this.#azimuth += azimuth;
    this.#elevation = Math.min(1.35, Math.max(0.08, this.#elevation + elevation));
    this.#stale = true;
    // The viewing direction is opposite to the position of the eye.
    this.#turned(this.#azimuth + Math.PI);
  }

  /** Number of lights that illuminate the scene. */
  get lightCount() {
    return Math.min(this.#list.length, QUALITIES[this.#quality][1]);
  }

  /** Takes the lights of a list. */
  setLights(lights) {
    this.#list = lights;
    this.#joinLights();
  }

  /** Lights below the horizon do not illuminate the scene. */
  #joinLights() {
    const up = [0, 0, 0];
    this.#count = 0;
    for (const { direction, irradiance, spread_rad } of firstLights(this.#list, this.lightCount)) {
      // RMS angle of a disc times this is its radius.
      const radius = Math.min(Math.max(Math.SQRT2 * spread_rad, LEAST_RADIUS_RAD), 1.2);
      const above = Math.min(1, Math.max(0, (direction[1] + Math.sin(radius)) / (2 * Math.sin(radius))));
      if (above === 0) continue;
      const shown = irradiance.map((part) => part * above);
      this.#lights.set([...direction, radius], 4 * this.#count);
      this.#lights.set([...shown, Math.sin(radius)], 4 * (MOST_LIGHTS + this.#count));
      for (let i = 0; i < 3; i++) up[i] += shown[i] * Math.max(direction[1], 0);
      this.#count++;
    }
    this.#fromGround = up.map((part, i) => (part * GROUND.colour[i]) / Math.PI);
    this.#stale = true;
  }

  /** To be called for every frame of the screen; draws when something is new and the last picture is done. */
  frame(now_ms) {
    const gl = this.#gl;
    if (gl === null || gl.isContextLost() || this.#busy(now_ms) || this.#canvas.clientWidth === 0) return;
    const adapting = this.#adapt(now_ms);
    const resized = fit(this.#canvas, QUALITIES[this.#quality][0]);
    if (!this.#stale && !adapting && !resized) return;
    this.#stale = false;
    this.#render();
    this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.#fenced_ms = now_ms;
    gl.flush();
  }

  /**
   * Whether the last picture is still being drawn, or was so slow that the rest of the page takes precedence.
   */
  #busy(now_ms) {
    const gl = this.#gl;
    if (this.#fence !== null) {
      const took_ms = now_ms - this.#fenced_ms;
      if (gl.getSyncParameter(this.#fence, gl.SYNC_STATUS) !== gl.SIGNALED && took_ms < 5000) return true;
      gl.deleteSync(this.#fence);
      this.#fence = null;
      this.#judge(took_ms);
      this.#rest_ms = took_ms < SLOW_MS ? 0 : now_ms + took_ms;
    }
    return now_ms < this.#rest_ms;
  }

  /** Chooses the quality of the next pictures by the time that a picture took. */
  #judge(took_ms) {
    const before = this.#quality;
    if (took_ms > SLOW_MS) {
      const cost = ([scale, lights]) => scale * scale * lights;
      const most = (cost(QUALITIES[before]) * SLOW_MS) / took_ms;
      const fitting = QUALITIES.findIndex((quality) => cost(quality) <= most);
      this.#quality = fitting === -1 ? QUALITIES.length - 1 : fitting;
      this.#patience = Math.min(Math.max(2 * this.#patience, FAST_IN_A_ROW), 64 * FAST_IN_A_ROW);
      this.#fast = 0;
    } else if (took_ms > FAST_MS) {
      this.#fast = 0;
    } else if (++this.#fast > this.#patience && this.#quality > 0) {
      this.#quality--;
      this.#fast = 0;
    }
    if (this.#quality !== before) this.#joinLights();
  }

  /** Advances the exposure; true while it is still adapting. */
  #adapt(now_ms) {
    const passed_s = Math.min((now_ms - this.#adapted_ms) / 1e3, 1);
    this.#adapted_ms = now_ms;
    const ground = luminance(this.#fromGround);
    if (!(ground > 0)) return false;
    const wanted = Math.log(KEY / ground);
    if (this.#exposure === null) this.#exposure = wanted;
    const left = wanted - this.#exposure;
    this.#exposure += left * (1 - Math.exp(-passed_s / ADAPTATION_S));
    return Math.abs(left) > 0.01;
  }

  #render() {
    const gl = this.#gl;
    const { width, height } = this.#canvas;
    gl.viewport(0, 0, width, height);
    gl.clearColor(...BACKGROUND, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    // Before the first light there is nothing to see.
    if (this.#exposure === null) return;
    gl.useProgram(this.#draw.program);
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.#buffer);
    gl.bufferSubData(gl.UNIFORM_BUFFER, 0, this.#lights);
    const { eye, camera } = view(this.#azimuth, this.#elevation, width / height);
    const { uniform } = this.#draw;
    gl.uniformMatrix4fv(uniform("camera"), false, camera);
    gl.uniform3fv(uniform("eye"), eye);
    gl.uniform1i(uniform("count"), this.#count);
    gl.uniform3fv(uniform("from_ground"), this.#fromGround);
    gl.uniform3fv(uniform("background"), BACKGROUND);
    gl.uniform1f(uniform("exposure"), Math.exp(this.#exposure));
    for (const { self, material, array, count } of this.#parts) {
      gl.uniform1i(uniform("self"), self);
      gl.uniform3fv(uniform("albedo"), material.colour);
      gl.uniform1f(uniform("metal"), material.metal);
      gl.uniform1f(uniform("roughness"), material.roughness);
      gl.bindVertexArray(array);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, 0);
    }
  }
}

/** The eye's position and the matrix from the world to clip space, in column-major order. */
function view(azimuth, elevation, aspect) {
  const target = [0, 0.52, 0.1];
  const back = [Math.cos(elevation) * Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation) * Math.sin(azimuth)];
  const right = [Math.sin(azimuth), 0, -Math.cos(azimuth)];
  const up = [back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0]];
  // Half the picture's height at distance 1: the objects fit in both height and width.
  const half = Math.max(0.27, 0.375 / aspect);
  const distance = 5.4;
  const eye = target.map((part, i) => part + distance * back[i]);
  const [near, far] = [1, 20];
  const along = (axis) => -(axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]);
  const [sx, sy] = [1 / (half * aspect), 1 / half];
  const [a, b] = [(near + far) / (near - far), (2 * near * far) / (near - far)];
  const camera = new Float32Array([
    sx * right[0], sy * up[0], a * back[0], -back[0],
    sx * right[1], sy * up[1], a * back[1], -back[1],
    sx * right[2], sy * up[2], a * back[2], -back[2],
    sx * along(right), sy * along(up), a * along(back) + b, -along(back),
  ]);
  return { eye, camera };
}
