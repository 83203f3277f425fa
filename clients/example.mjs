// The brightest light of every list, until interrupted (Node 22 or later):
//
//     node example.mjs ws://127.0.0.1:7300/ws [TOKEN]

import { LightcastClient } from "./lightcast.js";

const [url = "ws://127.0.0.1:7300/ws", token = null] = process.argv.slice(2);
const client = new LightcastClient(url, { token, subscription: { lights: 16, rate_hz: 5 } });
client.addEventListener("state", ({ detail: { state, reason } }) => console.error(state, reason));
client.addEventListener("list", ({ detail: list }) => {
  const luminance = ({ irradiance: [r, g, b] }) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
  const brightest = list.lights.reduce((a, b) => (luminance(b) > luminance(a) ? b : a));
  const [x, y, z] = brightest.direction.map((part) => part.toFixed(3));
  console.log(`list ${list.sequence}: ${list.lights.length} lights, brightest: ${brightest.id} at (${x}, ${y}, ${z})`);
});
client.connect();
