// The polar map as a disc, and the lights as rings on it: azimuthal equidistant about +Y, the polar angle
// from the centre, the azimuth anticlockwise from the right, as seen from below.

import { fit, luminance, program } from "/gl.js";

const VERTEX = `#version 300 es
out vec2 place;
void main() {
  place = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
  gl_Position = vec4(place, 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D map;
uniform float pixel;
in vec2 place;
out vec4 colour;
void main() {
  float radius = length(place) * RIM;
  float azimuth = atan(place.y, place.x) / 6.283185307;
  // Nothing is drawn beyond the rim, which is softened over one pixel.
  float inside = clamp((1.0 - radius) / pixel + 0.5, 0.0, 1.0);
  colour = vec4(textureLod(map, vec2(fract(azimuth), min(radius, 1.0)), 0.0).rgb * inside, inside);
}`;

/**
 * Margin around the disc, in units of its radius, for the wedge that shows the viewing direction of the
 * scene.
 */
const RIM = 1.07;
/**
 * Radius of the ring of a light with all the power, in parts of the disc's width; others scale with the
 * square root of their share.
 */
const FULL_RADIUS = 1 / 12;
const LEAST_RADIUS_PX = 2.5;
const GREEN = "rgb(40, 255, 60)";

export class MapDisc {
  #picture;
  #rings;
  #gl;
  #draw = null;
  #texture = null;
  #lights = [];
  #thetaMax = Math.PI / 2;
  #heading = null;

  /** The map is drawn on `picture`, the lights on `rings`, which lies above it. */
  constructor(picture, rings) {
    this.#picture = picture;
    this.#rings = rings;
    this.#gl = picture.getContext("webgl2", { antialias: false, premultipliedAlpha: true });
    if (this.#gl === null) return;
    this.#build();
    picture.addEventListener("webglcontextlost", (event) => event.preventDefault());
    // The next map fills the texture.
    picture.addEventListener("webglcontextrestored", () => this.#build());
  }

  #build() {
    const gl = this.#gl;
    this.#draw = program(gl, VERTEX, FRAGMENT.replace("RIM", RIM.toFixed(3)));
    this.#texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.#texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([33, 37, 44, 255]));
    this.drawMap();
  }

  /** Takes a new map; `bitmap` is closed. */
  setMap(bitmap, thetaMax) {
    this.#thetaMax = thetaMax;
    const gl = this.#gl;
    if (gl !== null && !gl.isContextLost()) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
      this.drawMap();
    }
    bitmap.close();
  }

  /** Draws the map again, for instance after a change of size. */
  drawMap() {
    const gl = this.#gl;
    if (gl === null) return;
    fit(this.#picture);
    gl.viewport(0, 0, this.#picture.width, this.#picture.height);
    gl.useProgram(this.#draw.program);
    gl.uniform1f(this.#draw.uniform("pixel"), (2 * RIM) / this.#picture.width);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  setLights(lights) {
    this.#lights = lights;
  }

  /** The azimuth in radians of the viewing direction of the scene. */
  setHeading(azimuth) {
    this.#heading = azimuth;
  }

  /** Draws the rings; lights beyond the rim of the map are left out. */
  drawRings() {
    fit(this.#rings);
    const context = this.#rings.getContext("2d");
    const size = this.#rings.width;
    const ratio = size / this.#rings.clientWidth;
    const half = size / 2;
    const rim = half / RIM;
    context.clearRect(0, 0, size, size);
    const total = this.#lights.reduce((sum, light) => sum + luminance(light.irradiance), 0);
    context.beginPath();
    for (const { direction: [x, y, z], irradiance } of this.#lights) {
      const share = luminance(irradiance) / total;
      const theta = Math.atan2(Math.hypot(x, z), y);
      // Filtered directions may lie slightly beyond the rim.
      if (!(share > 0) || theta > 1.1 * this.#thetaMax) continue;
      const distance = Math.min(theta / this.#thetaMax, 1.02) * rim;
      const azimuth = Math.atan2(z, x);
      const centre = [half + distance * Math.cos(azimuth), half - distance * Math.sin(azimuth)];
      const radius = Math.max(2 * rim * FULL_RADIUS * Math.sqrt(share), LEAST_RADIUS_PX * ratio);
      context.moveTo(centre[0] + radius, centre[1]);
      context.arc(...centre, radius, 0, 2 * Math.PI);
    }
    // Dark below green, so that it is visible on every sky.
    context.lineWidth = 3.4 * ratio;
    context.strokeStyle = "rgba(0, 20, 0, 0.55)";
    context.stroke();
    context.lineWidth = 1.6 * ratio;
    context.strokeStyle = GREEN;
    context.stroke();
    if (this.#heading !== null) this.#drawWedge(context, half, rim, ratio);
  }

  #drawWedge(context, half, rim, ratio) {
    context.save();
    context.translate(half, half);
    context.rotate(-this.#heading);
    context.translate(rim, 0);
    context.scale(ratio, ratio);
    context.beginPath();
    context.moveTo(1, 0);
    context.lineTo(11, -6);
    context.lineTo(11, 6);
    context.closePath();
    context.fillStyle = "#fff";
    context.fill();
    context.restore();
  }
}
