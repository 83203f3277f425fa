// The page: connects to the server and shows the lists. The modules do the drawing.

import { LightcastClient } from "/lightcast.js";
import { Age } from "/age.js";
import { luminance } from "/gl.js";
import { MapDisc } from "/map.js";
import { History, drawPlot } from "/plots.js";
import { Scene } from "/scene.js";
import { CountSlider } from "/slider.js";
import { parseStages, showStages } from "/stages.js";

const MAP_EVERY_MS = 500;
const METRICS_EVERY_MS = 2000;
const TEXT_EVERY_MS = 200;
/** A request that takes longer is given up. */
const PATIENCE_MS = 10_000;
/** After this long without a list the page says so. */
const SILENT_MS = 3000;
/** Number of lists over which the rate is measured. */
const RATE_LISTS = 50;
const TOKEN_KEY = "lightcast-token";

const at = (id) => document.getElementById(id);
const say = (id, text) => {
  // Writes only changes, so that a screen reader and the layout are not disturbed.
  if (at(id).textContent !== text) at(id).textContent = text;
};
const percent = (part) => `${(100 * part).toPrecision(2)} %`;

/** The newest list, and the arrival times of it and of those before it. */
let list = null;
let arrivals = [];
/** Whether the rings have to be drawn again. */
let changed = true;
let age = new Age();
let lostLists = 0;
let lostFrames = 0;
let retryAt = 0;
let token = null;
/** Whether a list has arrived since the connection was opened. */
let fresh = false;
/**
 * Whether the lists that arrive have all lights; false until the server has received the request for all of
 * them.
 */
let isWhole = false;

const socketUrl = new URL("/ws", location.href);
socketUrl.protocol = location.protocol === "https:" ? "wss:" : "ws:";
const client = new LightcastClient(socketUrl);
const map = new MapDisc(at("map-picture"), at("map-rings"));
const scene = new Scene(at("scene-picture"), (azimuth) => {
  map.setHeading(azimuth);
  changed = true;
});
const slider = new CountSlider(at("count"), at("count-asked"), (subscription) => {
  isWhole = false;
  client.subscribe(subscription);
});
const powers = new History(1);
const errors = new History(1);

// --- Connection

client.addEventListener("state", ({ detail: { state, retry_ms } }) => {
  if (state === "open") {
    fresh = false;
    arrivals = [];
    age = new Age();
    lostLists = lostFrames = 0;
    isWhole = client.subscription.lights === undefined;
    say("count-fault", "");
  }
  if (retry_ms !== null) {
    retryAt = performance.now() + retry_ms;
    askWhetherATokenIsNeeded();
  }
  showState();
});

client.addEventListener("list", ({ detail }) => {
  const now = performance.now();
  // The losses before a list that did not arrive are not known: missing numbers are lists that this
  // connection was too slow for, or frames. (It asks for all lists; a lower rate would leave out others.)
  if (fresh) lostFrames += Math.max(0, detail.sequence - list.sequence - 1 - detail.stream.lost);
  list = detail;
  fresh = true;
  changed = true;
  arrivals.push(now);
  if (arrivals.length > RATE_LISTS) arrivals.shift();
  lostLists += list.stream.lost;
  age.take(list.stream);
  map.setLights(list.lights);
  scene.setLights(list.lights);
  powers.push(now / 1e3, [luminance(list.power)]);
  errors.push(now / 1e3, [100 * list.error]);
  if (isWhole) slider.setAll(list.lights.length);
  const brightest = list.lights.reduce((a, b) => (luminance(b.irradiance) > luminance(a.irradiance) ? b : a), list.lights[0]);
  Object.assign(document.body.dataset, {
    sequence: list.sequence,
    lights: list.lights.length,
    brightest: brightest === undefined ? "" : brightest.direction.map((part) => part.toFixed(5)).join(" "),
  });
});

client.addEventListener("answer", ({ detail: { subscribed, error } }) => {
  if (subscribed !== undefined) isWhole = (subscribed.lights ?? null) === null;
  say("count-fault", error ?? "");
});

function showState() {
  const { state, reason } = client.state;
  const since = arrivals.length === 0 ? Infinity : performance.now() - arrivals.at(-1);
  let name = state;
  let text = `connecting to ${location.host}`;
  // Separate from the text, which is read out when it changes.
  let wait = "";
  if (!at("token-form").hidden) {
    [name, text] = ["token", "no connection without a token"];
  } else if (state === "closed") {
    const seconds = Math.max(0, Math.ceil((retryAt - performance.now()) / 1e3));
    text = `disconnected: ${reason}`;
    if (client.state.retry_ms !== null) wait = `next attempt in ${seconds} s`;
  } else if (state === "open" && !fresh) {
    [name, text] = ["waiting", "connected, waiting for the first list"];
  } else if (state === "open" && since > Math.max(SILENT_MS, 3 * interval())) {
    [name, text, wait] = ["silent", "connected, but no list comes", `for ${Math.floor(since / 1e3)} s`];
  } else if (state === "open") {
    [name, text] = ["live", "live"];
  }
  document.body.dataset.state = name;
  say("state-text", text);
  say("state-wait", wait);
  at("retry").hidden = name !== "closed";
}

at("retry").addEventListener("click", () => client.connect());

/** Mean time between lists in milliseconds; 0 before the second. */
function interval() {
  return arrivals.length < 2 ? 0 : (arrivals.at(-1) - arrivals[0]) / (arrivals.length - 1);
}

// --- Token

/** The token from the address, `#token=...`, or from an earlier visit; it is removed from the address. */
function storedToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given === null) return sessionStorage.getItem(TOKEN_KEY);
  history.replaceState(null, "", location.pathname + location.search);
  return given;
}

function useToken(given) {
  try {
    client.token = given;
  } catch (error) {
    askForToken(error.message);
    return;
  }
  token = given;
  if (given !== null) sessionStorage.setItem(TOKEN_KEY, given);
  at("token-form").hidden = true;
  client.connect();
}

function askForToken(fault) {
  client.close();
  at("token-form").hidden = false;
  say("token-fault", fault);
  showState();
}

/** A WebSocket does not give the reason for a refusal; this request does. */
async function askWhetherATokenIsNeeded() {
  const asked = token;
  const answer = await get("/lights");
  if (answer?.status !== 401 || token !== asked || !at("token-form").hidden) return;
  sessionStorage.removeItem(TOKEN_KEY);
  askForToken(asked === null ? "" : "The server does not take this token.");
}

addEventListener("hashchange", () => useToken(storedToken()));
at("token-form").addEventListener("submit", (event) => {
  event.preventDefault();
  useToken(at("token").value.trim());
});

// --- What is fetched

/** The answer of any status; null when there is none. */
async function get(path) {
  const headers = token === null ? {} : { Authorization: `Bearer ${token}` };
  try {
    return await fetch(path, { headers, cache: "no-store", signal: AbortSignal.timeout(PATIENCE_MS) });
  } catch {
    return null;
  }
}

async function fetchMap() {
  const answer = await get("/map.png");
  if (!answer?.ok) return;
  const thetaMax = Number(answer.headers.get("Lightcast-Theta-Max-Rad"));
  if (!(thetaMax > 0)) return;
  map.setMap(await createImageBitmap(await answer.blob()), thetaMax);
  document.body.dataset.mapSequence = answer.headers.get("Lightcast-Sequence");
  say("map-note", `seen from below, rim at ${Math.round((thetaMax * 180) / Math.PI)}\u00b0`);
  changed = true;
}

async function fetchStages() {
  const answer = await get("/metrics");
  if (answer?.ok) showStages(at("stage-rows"), parseStages(await answer.text()));
}

/** Repeats `act` while the page is visible and lists arrive. */
async function repeat(act, every_ms) {
  for (;;) {
    if (!document.hidden && client.state.state === "open" && fresh) {
      // A connection that breaks in between is reported elsewhere.
      await act().catch(() => {});
    }
    await new Promise((done) => setTimeout(done, every_ms));
  }
}

document.addEventListener("visibilitychange", () => {
  if (!document.hidden && client.state.retry_ms !== null) client.connect();
});

// --- Numbers

function showNumbers() {
  const now_s = performance.now() / 1e3;
  showState();
  if (list === null) return;
  const step = interval();
  if (scene.works) {
    const joined = scene.lightCount < list.lights.length ? ` for speed, joined from ${list.lights.length}` : "";
    say("scene-note", `by ${scene.lightCount} ${scene.lightCount === 1 ? "light" : "lights"}${joined}`);
  }
  say("sequence", String(list.sequence));
  say("arriving", String(list.lights.length));
  say("error", percent(list.error));
  say("rate", step > 0 ? (1e3 / step).toFixed(1) : "\u2013");
  say("age", age.ms === null ? "\u2013" : `${age.ms.toFixed(0)} ms`);
  say("delay", `${((1e3 * list.filter_delay_frames) / list.frame_rate_hz).toFixed(0)} ms`);
  say("lost", String(lostLists));
  say("frames-lost", String(lostFrames));
  say("power-now", `${luminance(list.power).toPrecision(3)} (relative)`);
  say("error-now", percent(list.error));
  if (document.hidden) return;
  drawPlot(at("power-plot"), powers, now_s, { colours: ["#e6e8eb"], label: (value) => String(Number(value.toPrecision(3))) });
  drawPlot(at("error-plot"), errors, now_s, { colours: ["#ffb454"], label: (value) => `${Number(value.toPrecision(3))} %` });
}

function frame(now_ms) {
  if (changed) {
    changed = false;
    map.drawRings();
  }
  scene.frame(now_ms);
  requestAnimationFrame(frame);
}

new ResizeObserver(() => {
  changed = true;
  map.drawMap();
}).observe(at("disc"));
if (!scene.works) say("scene-note", "this browser has no WebGL 2 to draw it");
setInterval(showNumbers, TEXT_EVERY_MS);
repeat(fetchMap, MAP_EVERY_MS);
repeat(fetchStages, METRICS_EVERY_MS);
requestAnimationFrame(frame);
useToken(storedToken());
