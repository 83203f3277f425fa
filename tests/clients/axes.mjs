// Directions for other programs, by where these show a panorama's sun; addresses as they are typed.

import assert from "node:assert/strict";
import { test } from "node:test";
import { LightcastClient, directionIn } from "../../clients/lightcast.js";

// Columns and rows of suns in a lat-long panorama, from its upper left corner, as fractions of its size.
const SUNS = [[0.5, 0.5], [0.31, 0.22], [0.87, 0.4], [0.06, 0.71]];

/** A light at a place of a panorama, in our axes: the middle is +Z, left of it +X, the top row +Y. */
function light([u, v]) {
  const [theta, phi] = [Math.PI * v, 2 * Math.PI * u - Math.PI / 2];
  return { direction: [Math.sin(theta) * Math.cos(phi), Math.cos(theta), Math.sin(theta) * Math.sin(phi)] };
}

/** Where each program's mapping looks a direction up: columns from the left, rows from the bottom. */
const PLACES = {
  blender: ([x, y, z]) => [-Math.atan2(y, x) / (2 * Math.PI) + 0.5, Math.atan2(z, Math.hypot(x, y)) / Math.PI + 0.5],
  three: ([x, y, z]) => [Math.atan2(z, x) / (2 * Math.PI) + 0.5, Math.asin(y) / Math.PI + 0.5],
};

test("a sun stands where the program shows it", () => {
  for (const [program, place] of Object.entries(PLACES)) {
    for (const [u, v] of SUNS) {
      const [column, row] = place(directionIn(light([u, v]), program));
      assert.ok(Math.abs(column - u) < 1e-12 && Math.abs(row - (1 - v)) < 1e-12, `${program} ${u} ${v}`);
    }
  }
  assert.deepEqual(directionIn(light(SUNS[1]), "world"), light(SUNS[1]).direction);
  assert.throws(() => directionIn(light(SUNS[1]), "maya"), /maya: unknown axes; there are blender, three, world/);
});

test("addresses are those that watch takes", () => {
  const before = globalThis.WebSocket;
  const opened = [];
  globalThis.WebSocket = class extends EventTarget {
    constructor(url) {
      super();
      opened.push(url);
    }
    close() {}
  };
  try {
    for (const typed of ["studio:7300", "ws://studio:7300", "http://studio:7300/", "https://studio.example"]) {
      const client = new LightcastClient(typed);
      client.connect();
      client.close();
    }
  } finally {
    globalThis.WebSocket = before;
  }
  const ours = "ws://studio:7300/ws";
  assert.deepEqual(opened, [ours, ours, ours, "wss://studio.example/ws"]);
  for (const wrong of ["", ":7300", "ftp://studio", "studio:http"]) {
    assert.throws(() => new LightcastClient(wrong), /is no address of a server/, wrong);
  }
});
