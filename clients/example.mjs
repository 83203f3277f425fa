// The brightest light of every list, until interrupted:
//
//     node example.mjs [127.0.0.1:7300 [TOKEN]]
//
// In Node 20 after `npm install ws`.

import { LightcastClient } from "./lightcast_node.js";

const [url = "127.0.0.1:7300", token = null] = process.argv.slice(2);
const client = new LightcastClient(url, { token, subscription: { lights: 16, rate_hz: 5 } });
client.addEventListener("state", ({ detail: { state, reason } }) => console.error(state, reason));
client.addEventListener("list", ({ detail: list }) => {
  const luminance = ({ irradiance: [r, g, b] }) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
  const [brightest] = list.lights.toSorted((a, b) => luminance(b) - luminance(a));
  const where = brightest?.direction.map((part) => part.toFixed(3)).join(", ");
  console.log(
    `list ${list.sequence}: ${list.lights.length} lights` +
      (brightest === undefined ? "" : `, brightest: ${brightest.id} at (${where})`),
  );
});
// Whoever reads has seen enough (`| head`).
process.stdout.on("error", () => process.exit());
client.connect();
