// Lines over the last minute.

import { fit } from "/gl.js";

const SECONDS = 60;
/** Most samples that are kept; the time between them is at least a minute divided by this. */
const SAMPLES = 2400;
/** A longer time without a sample is a gap in the line. */
const GAP_S = 2;
const FONT = "12px system-ui, sans-serif";

/** Values with their times, the last minute of them, in a ring. */
export class History {
  #times = new Float64Array(SAMPLES);
  #values;
  #next = 0;
  #length = 0;

  /** Every time has `lines` values. */
  constructor(lines) {
    this.#values = Array.from({ length: lines }, () => new Float64Array(SAMPLES));
  }

  /** Adds a sample for the current time; one that comes too soon after the last one is skipped. */
  push(time_s, values) {
    const last = (this.#next + SAMPLES - 1) % SAMPLES;
    if (this.#length > 0 && time_s - this.#times[last] < SECONDS / SAMPLES) return;
    this.#times[this.#next] = time_s;
    values.forEach((value, line) => (this.#values[line][this.#next] = value));
    this.#next = (this.#next + 1) % SAMPLES;
    this.#length = Math.min(this.#length + 1, SAMPLES);
  }

  get lines() {
    return this.#values.length;
  }

  /** Calls `sample(time, value)` for one line's samples from `since` on, oldest first. */
  each(line, since_s, sample) {
    for (let i = 0; i < this.#length; i++) {
      const at = (this.#next + 2 * SAMPLES - this.#length + i) % SAMPLES;
      if (this.#times[at] >= since_s) sample(this.#times[at], this.#values[line][at]);
    }
  }
}

/** Ends of scales, in units of a power of ten, and the number of steps into which each is divided. */
const SCALES = [[1, 5], [1.5, 3], [2, 4], [3, 3], [4, 4], [5, 5], [6, 3], [8, 4], [10, 5]];

/** The shortest scale from 0 that holds `value`: its end and its number of steps. */
export function scaleFor(value) {
  if (!(value > 0) || !Number.isFinite(value)) return [1, 5];
  const decade = 10 ** Math.floor(Math.log10(value));
  const [end, steps] = SCALES.find(([end]) => end * decade >= value) ?? SCALES.at(-1);
  return [end * decade, steps];
}

/**
 * Draws a history from 0 up.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {History} history
 * @param {number} now_s the right end
 * @param {{colours: string[], label: (value: number) => string}} look
 */
export function drawPlot(canvas, history, now_s, { colours, label }) {
  fit(canvas);
  const context = canvas.getContext("2d");
  const ratio = canvas.width / canvas.clientWidth;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = FONT;

  let most = 0;
  for (let line = 0; line < history.lines; line++) {
    history.each(line, now_s - SECONDS, (_, value) => (most = Math.max(most, value)));
  }
  // A little space above the line.
  const [top, steps] = scaleFor(most * 1.04);
  const labels = Array.from({ length: steps + 1 }, (_, step) => label((top * step) / steps));
  const left = Math.ceil(Math.max(...labels.map((text) => context.measureText(text).width))) + 8;
  const box = { left, right: width - 2, top: 8, bottom: height - 20 };
  const x = (time_s) => box.right - ((now_s - time_s) / SECONDS) * (box.right - box.left);
  const y = (value) => box.bottom - (value / top) * (box.bottom - box.top);

  context.lineWidth = 1;
  context.fillStyle = "#9da5b0";
  context.textAlign = "right";
  context.textBaseline = "middle";
  labels.forEach((text, step) => {
    const at = Math.round(y((top * step) / steps)) + 0.5;
    context.strokeStyle = step === 0 ? "#5a626e" : "#2a2f37";
    context.beginPath();
    context.moveTo(box.left, at);
    context.lineTo(box.right, at);
    context.stroke();
    context.fillText(text, box.left - 6, at);
  });
  context.textBaseline = "alphabetic";
  for (const [seconds, align] of [[60, "left"], [40, "center"], [20, "center"], [0, "right"]]) {
    context.textAlign = align;
    context.fillText(seconds === 0 ? "now" : `\u2212${seconds} s`, x(now_s - seconds), height - 4);
  }

  context.save();
  context.beginPath();
  context.rect(box.left, 0, box.right - box.left, height);
  context.clip();
  context.lineWidth = 1.6;
  context.lineJoin = "round";
  for (let line = 0; line < history.lines; line++) {
    let last = -Infinity;
    context.strokeStyle = colours[line];
    context.beginPath();
    // One more second, so that the line begins at the edge.
    history.each(line, now_s - SECONDS - 1, (time_s, value) => {
      if (time_s - last > GAP_S) context.moveTo(x(time_s), y(value));
      else context.lineTo(x(time_s), y(value));
      last = time_s;
    });
    context.stroke();
  }
  context.restore();
}
