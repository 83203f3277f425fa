/**
 * Light lists from a lightcast server, in browsers and in Node 22 and later. One file, an ES module, no dependencies.
 * In Node 20, which has no WebSocket, lightcast_node.js brings that of the package `ws`. The decoders work from Node
 * 18 on.
 *
 *     const client = new LightcastClient("127.0.0.1:7300", { subscription: { lights: 64 } });
 *     client.addEventListener("list", ({ detail }) => console.log(detail.sequence, detail.lights.length));
 *     client.connect();
 *
 * The protocol is described in docs/protocol.md. Directions are unit vectors from the scene towards the light, in a
 * right-handed world with +Y up, the centre of a panorama +Z and left of it +X; {@link directionIn} turns them for
 * other programs. Irradiances are linear Rec. 709, on a surface that faces the light.
 */

/** WebSocket subprotocol of lists as bytes. */
export const BINARY = "lightcast.v1.bin";
/** WebSocket subprotocol of lists as JSON. */
export const JSON_TEXT = "lightcast.v1.json";
/** Prefix of the token where it is sent as a WebSocket subprotocol. */
const TOKEN_PREFIX = "lightcast.token.";

/** Most lights and prefix errors that are accepted in a list, and most characters of it as JSON. */
const MAX_LIGHTS = 16384;
const MAX_PREFIX_ERRORS = 64;
const MAX_CHARACTERS = 2 ** 23;
const HEADER_BYTES = 120;
const PREFIX_ERROR_BYTES = 8;
const LIGHT_BYTES = 14;
/** Steps per octave in a quantity's code. */
const STEPS = 1024;
/** How far a direction may be from length 1: four written digits. */
const LENGTH_TOLERANCE = 1e-3;
const MOST_IRRADIANCE = 1e30;
const MOST_POWER = 1e36;
/** Pi, as the server rounds it. */
const MOST_SPREAD_RAD = Math.fround(Math.PI);
/** The largest 32-bit and 64-bit integers, as far as a number can represent them. */
const MOST_U32 = 2 ** 32 - 1;
const MOST_U64 = 2 ** 64;
const MOST_TIME_NS = 2 ** 63;

/** After this long without a message the server is asked to answer; after as long again it is given up. */
const PATIENCE_MS = 10_000;

/**
 * @typedef {object} Light
 * @property {number} id the same light from list to list
 * @property {[number, number, number]} direction
 * @property {[number, number, number]} irradiance RGB
 * @property {number} spread_rad RMS angle of what the light stands for about its direction
 *
 * @typedef {object} Stream what goes with a list; nanoseconds, rounded to what a number holds (256 ns for UTC)
 * @property {number} lost lists that this client was too slow for since its last one
 * @property {number | null} capture_monotonic_ns by the server's CLOCK_MONOTONIC; null where it is unknown
 * @property {number | null} capture_utc_ns
 * @property {number} sent_monotonic_ns
 * @property {number} sent_utc_ns
 *
 * @typedef {object} LightList
 * @property {number} version 1
 * @property {number} sequence
 * @property {number} capture_time_ns
 * @property {number} lost_before frames that were lost before this one
 * @property {number} frame_rate_hz
 * @property {number} filter_delay_frames
 * @property {string} unit
 * @property {[number, number, number]} power RGB sum of the lights
 * @property {number} error relative RMS error of the irradiance
 * @property {[number, number][]} prefix_errors pairs of a number of lights and its error
 * @property {Light[]} lights
 * @property {Stream} stream
 *
 * @typedef {object} Subscription keys that are missing have their defaults
 * @property {number} [lights] at most this many; default: all
 * @property {number} [error] the shortest list whose error is under this
 * @property {number} [rate_hz] at most this many lists a second; default: all
 * @property {number} [queue] lists that wait when this client is slow, 1 to 64; default: 1
 *
 * @typedef {object} State
 * @property {"connecting" | "open" | "closed"} state
 * @property {string} reason why it is closed, otherwise ""
 * @property {number | null} retry_ms when closed: milliseconds until it connects again; null when it does not
 */

/** The number that a quantity's code stands for, relative to the largest. */
const PART_OF_TOP = new Float64Array(65536);
for (let code = 1; code < 65536; code++) PART_OF_TOP[code] = 2 ** ((code - 65535) / STEPS);

/**
 * Decodes a message of the subprotocol {@link BINARY}.
 *
 * @param {ArrayBuffer} buffer
 * @returns {LightList}
 * @throws {Error} that says which byte is wrong
 */
export function decodeBinary(buffer) {
  const length = buffer.byteLength;
  if (length < HEADER_BYTES) fail(`has ${length} bytes; the header alone has ${HEADER_BYTES}`);
  const view = new DataView(buffer);
  // "LCL" and the version, in the order of the bytes.
  const magic = view.getUint32(0, false);
  if (magic >>> 8 !== 0x4c434c) fail("byte 0: does not begin with LCL");
  if ((magic & 255) !== 1) fail(`byte 3: is of version ${magic & 255}; this client reads version 1`);
  const header = view.getUint16(4, true);
  if (header < HEADER_BYTES) fail(`byte 4: a header of ${header} bytes; it has at least ${HEADER_BYTES}`);
  const prefixes = view.getUint16(116, true);
  const count = view.getUint16(118, true);
  if (prefixes > MAX_PREFIX_ERRORS) fail(`byte 116: ${prefixes} prefix errors; at most ${MAX_PREFIX_ERRORS} are read`);
  if (count > MAX_LIGHTS) fail(`byte 118: ${count} lights; at most ${MAX_LIGHTS} are read`);
  const wanted = header + PREFIX_ERROR_BYTES * prefixes + LIGHT_BYTES * count;
  if (length !== wanted) {
    fail(`has ${length} bytes; with ${prefixes} prefix errors and ${count} lights it would have ${wanted}`);
  }

  const captured = (view.getUint16(6, true) & 1) === 1;
  const brightest = view.getFloat32(112, true);
  if (!isNumber(brightest, MOST_IRRADIANCE)) fail("byte 112: the brightest is not from 0 to 1e30");
  const int64 = (byte) => Number(view.getBigInt64(byte, true));
  const uint64 = (byte) => Number(view.getBigUint64(byte, true));
  const list = {
    version: 1,
    sequence: uint64(48),
    capture_time_ns: int64(56),
    lost_before: uint64(64),
    frame_rate_hz: view.getFloat64(72, true),
    filter_delay_frames: view.getUint32(104, true),
    unit: "relative",
    power: [view.getFloat64(80, true), view.getFloat64(88, true), view.getFloat64(96, true)],
    error: view.getFloat32(108, true),
    prefix_errors: new Array(prefixes),
    lights: new Array(count),
    stream: {
      lost: uint64(8),
      capture_monotonic_ns: captured ? int64(16) : null,
      capture_utc_ns: captured ? int64(24) : null,
      sent_monotonic_ns: int64(32),
      sent_utc_ns: int64(40),
    },
  };
  let byte = header;
  for (let i = 0; i < prefixes; i++, byte += PREFIX_ERROR_BYTES) {
    list.prefix_errors[i] = [view.getUint32(byte, true), view.getFloat32(byte + 4, true)];
  }
  for (let i = 0; i < count; i++, byte += LIGHT_BYTES) {
    const code = (n) => view.getUint16(byte + 2 * n, true);
    list.lights[i] = {
      id: code(0),
      direction: octahedral(code(1), code(2)),
      irradiance: [brightest * PART_OF_TOP[code(3)], brightest * PART_OF_TOP[code(4)], brightest * PART_OF_TOP[code(5)]],
      spread_rad: Math.PI * PART_OF_TOP[code(6)],
    };
  }
  return checked(list);
}

/** The direction of an octahedral code about +Y (Meyer et al. 2010). */
function octahedral(u, v) {
  let a = u / 32767.5 - 1;
  let b = v / 32767.5 - 1;
  const y = 1 - Math.abs(a) - Math.abs(b);
  if (y < 0) {
    [a, b] = [(1 - Math.abs(b)) * (a < 0 ? -1 : 1), (1 - Math.abs(a)) * (b < 0 ? -1 : 1)];
  }
  const scale = 1 / Math.hypot(a, y, b);
  return [a * scale, y * scale, b * scale];
}

/**
 * Decodes a message of the subprotocol {@link JSON_TEXT}.
 *
 * @param {string} text
 * @returns {LightList}
 * @throws {Error} that says what is wrong
 */
export function decodeJson(text) {
  return read(parsed(text));
}

/** The list that a JSON object describes. */
function read(list) {
  if (list.version !== 1) fail("version: is not 1, which this client reads");
  if (!Array.isArray(list.lights)) fail("lights: is no array");
  if (list.lights.length > MAX_LIGHTS) fail(`lights: ${list.lights.length} of them; at most ${MAX_LIGHTS} are read`);
  list.prefix_errors ??= [];
  if (!Array.isArray(list.prefix_errors)) fail("prefix_errors: is no array");
  if (list.prefix_errors.length > MAX_PREFIX_ERRORS) {
    fail(`prefix_errors: ${list.prefix_errors.length} of them; at most ${MAX_PREFIX_ERRORS} are read`);
  }
  const stream = list.stream;
  if (stream === null || typeof stream !== "object") fail("stream: is no object");
  for (const key of ["sent_monotonic_ns", "sent_utc_ns"]) {
    if (!isTime(stream[key])) fail(`stream.${key}: is no time`);
  }
  for (const key of ["capture_monotonic_ns", "capture_utc_ns"]) {
    if (stream[key] !== null && !isTime(stream[key])) fail(`stream.${key}: is neither a time nor null`);
  }
  if (!isCount(stream.lost, MOST_U64)) fail("stream.lost: is no count");
  return checked(list);
}

/** A JSON object. */
function parsed(text) {
  if (text.length > MAX_CHARACTERS) fail(`has more than ${MAX_CHARACTERS} characters`);
  let object = null;
  try {
    object = JSON.parse(text);
  } catch (error) {
    fail(`is no JSON: ${error.message}`);
  }
  if (object === null || typeof object !== "object") fail("is no JSON object");
  return object;
}

const isNumber = (value, most) => typeof value === "number" && value >= 0 && value <= most;
const isCount = (value, most) => Number.isInteger(value) && isNumber(value, most);
const isTime = (value) => Number.isInteger(value) && Math.abs(value) <= MOST_TIME_NS;
const isTriple = (value, most) =>
  Array.isArray(value) && value.length === 3 && value.every((part) => isNumber(part, most));

/** Returns the list if its numbers are valid. */
function checked(list) {
  for (const key of ["sequence", "lost_before"]) if (!isCount(list[key], MOST_U64)) fail(`${key}: is no count`);
  if (!isCount(list.filter_delay_frames, MOST_U32)) fail("filter_delay_frames: is no count");
  if (!isTime(list.capture_time_ns)) fail("capture_time_ns: is no time");
  for (const key of ["frame_rate_hz", "error"]) {
    if (!isNumber(list[key], Number.MAX_VALUE)) fail(`${key}: is no number from 0 on`);
  }
  if (!isTriple(list.power, MOST_POWER)) fail("power: is not three numbers from 0 to 1e36");
  for (const pair of list.prefix_errors) {
    const isPair = Array.isArray(pair) && pair.length === 2;
    if (!isPair || !isCount(pair[0], MOST_U32) || !isNumber(pair[1], Number.MAX_VALUE)) {
      fail("prefix_errors: is not pairs of a count and an error from 0 on");
    }
  }
  const ids = new Set();
  list.lights.forEach((light, number) => {
    const where = `light ${number}:`;
    if (light === null || typeof light !== "object") fail(`${where} is no object`);
    const { id, direction, irradiance, spread_rad } = light;
    if (!isCount(id, MOST_U32)) fail(`${where} its id is no count`);
    if (ids.has(id)) fail(`${where} a light before it has the id ${id}`);
    ids.add(id);
    const numbers = Array.isArray(direction) && direction.length === 3 && direction.every(Number.isFinite);
    if (!numbers || Math.abs(Math.hypot(...direction) - 1) > LENGTH_TOLERANCE) {
      fail(`${where} its direction is no unit vector`);
    }
    if (!isTriple(irradiance, MOST_IRRADIANCE)) fail(`${where} its irradiance is not from 0 to 1e30`);
    if (!isNumber(spread_rad, MOST_SPREAD_RAD)) fail(`${where} its spread_rad is no angle from 0 to pi`);
  });
  return list;
}

/** A direction by the axes of each program. */
const AXES = {
  world: ([x, y, z]) => [x, y, z],
  blender: ([x, y, z]) => [z, x, y],
  three: ([x, y, z]) => [z, y, -x],
};

/**
 * A direction by the axes of Blender (+Z up) or three.js, so that the light stands where that program shows it in the
 * same panorama.
 *
 * @param {[number, number, number]} direction of a {@link Light}
 * @param {"world" | "blender" | "three"} axes "world" gives it as it is
 * @returns {[number, number, number]}
 * @throws {Error} for other names
 */
export function directionIn(direction, axes) {
  if (!Object.hasOwn(AXES, axes)) {
    throw new Error(`axes: "${axes}" is not known; give one of ${Object.keys(AXES).join(", ")}`);
  }
  return AXES[axes](direction);
}

/** Scheme, TLS, authority, path and query of a server's address. Fragments are for pages. */
const ADDRESS = /^(?:(ws|http)(s?):\/\/)?([^\s/?#\\]+)(\/[^\s?#]*)?(\?[^\s#]*)?(?:#\S*)?$/i;

/** The address of the stream that a text names. */
function address(text) {
  const [, scheme, secure = "", authority = "", path = "/", query = ""] = ADDRESS.exec(text) ?? [];
  try {
    const url = new URL(`ws${secure}://${authority}${path === "/" ? "/ws" : path}${query}`);
    if (url.port !== "0" && (scheme !== undefined || /:\d+$/.test(authority))) return url;
  } catch {
    // Told below, as all that is no address.
  }
  throw new Error(`"${text}" is no address of a server, such as ws://127.0.0.1:7300`);
}

function fail(what) {
  throw new Error(`the message is no light list: ${what}`);
}

/**
 * A connection that is restored when it is lost.
 *
 * Events, each a `CustomEvent`: `list` with a {@link LightList}, `state` with a {@link State}, `answer` with
 * what the server says to a subscription (`{subscribed: {...}}` or `{error: "..."}`), and `fault` with an
 * `Error` for a message that cannot be read, after which the connection is closed and tried again. A server
 * that is silent is asked to answer by sending the subscription once more, and given up when it does not
 * answer that either.
 */
export class LightcastClient extends EventTarget {
  #url;
  #format;
  #token;
  #subscription;
  /** The last subscription that the server accepted: one that it refuses is not sent again. */
  #agreed;
  /** Subscriptions that the server has not answered yet, and whether an `answer` event is wanted. */
  #unanswered = [];
  #delays;
  #WebSocket;
  #socket = null;
  #timer = null;
  #attempts = 0;
  #openedAt = 0;
  /** Time of the server's last message or of the last request to answer, and whether it was asked since. */
  #heardAt = 0;
  #isAsked = false;
  /** @type {State} */
  #state = { state: "closed", reason: "not connected yet", retry_ms: null };

  /**
   * @param {string | URL} url `ws://HOST:PORT`, the address of the server's page, or `HOST:PORT`; through TLS
   *   `wss://...`, or the address of the page there. Without a path it is `/ws`.
   * @param {object} [options]
   * @param {"binary" | "json"} [options.format] default: binary
   * @param {string | null} [options.token] where the server asks for one
   * @param {Subscription} [options.subscription] default: everything
   * @param {number} [options.retryMinMs] wait before the first new attempt; it doubles with each. Default: 250
   * @param {number} [options.retryMaxMs] longest wait. Default: 8000
   * @param {typeof WebSocket} [options.WebSocket] default: the one that is global when it connects
   * @throws {Error} when the URL is no such address, or the token has characters that a URL's path may not have
   */
  constructor(
    url,
    { format = "binary", token = null, subscription = {}, retryMinMs = 250, retryMaxMs = 8000, WebSocket } = {},
  ) {
    super();
    if (format !== "binary" && format !== "json") throw new Error(`format: "binary" or "json", not "${format}"`);
    this.#url = address(String(url));
    this.#format = format;
    this.token = token;
    this.#subscription = { ...subscription };
    this.#delays = { min: retryMinMs, max: retryMaxMs };
    this.#WebSocket = WebSocket;
  }

  /** The state of the last `state` event. */
  get state() {
    return this.#state;
  }

  /** The subscription that is sent to the server. */
  get subscription() {
    return { ...this.#subscription };
  }

  /** Used from the next attempt to connect on; null for none. */
  set token(token) {
    if (token !== null && !/^[A-Za-z0-9._~-]+$/.test(token)) {
      throw new Error("the token: letters, digits and - . _ ~ can be sent, nothing else");
    }
    this.#token = token;
  }

  /** Connects now, and again whenever the connection is lost, until {@link close}. */
  connect() {
    this.#forget();
    this.#attempts = 0;
    this.#attempt();
  }

  /** Ends the connection and the attempts. */
  close() {
    this.#forget();
    this.#tell("closed", "closed by this client", null);
  }

  /**
   * Changes the subscription; an `answer` event says whether the server accepts it, and if not the old one
   * stays. While there is no connection, the next one begins with it.
   *
   * @param {Subscription} subscription replaces the whole of the previous one
   */
  subscribe(subscription) {
    this.#subscription = { ...subscription };
    if (this.#state.state === "open") this.#ask(true);
  }

  #ask(isTold) {
    this.#unanswered.push({ subscription: this.#subscription, isTold });
    this.#socket.send(JSON.stringify({ subscribe: this.#subscription }));
  }

  #attempt() {
    const url = new URL(this.#url);
    for (const [key, value] of Object.entries(this.#subscription)) url.searchParams.set(key, String(value));
    const protocols = [this.#format === "binary" ? BINARY : JSON_TEXT];
    if (this.#token !== null) protocols.push(TOKEN_PREFIX + this.#token);
    const WebSocket = this.#WebSocket ?? globalThis.WebSocket;
    if (WebSocket === undefined) {
      this.#tell("closed", "no WebSocket here; before Node 22 the package ws has one: npm install ws", null);
      return;
    }
    let socket;
    try {
      socket = new WebSocket(url.href, protocols);
    } catch (error) {
      // Not allowed from this page, or not an address of a WebSocket: the next attempt would fail too.
      this.#tell("closed", error.message, null);
      return;
    }
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    const mine = (act) => (event) => {
      // Events of an abandoned socket are ignored.
      if (this.#socket === socket) act(event);
    };
    const asked = this.#subscription;
    let wasOpen = false;
    let fault = "";
    socket.addEventListener("open", mine(() => {
      wasOpen = true;
      this.#openedAt = this.#heardAt = performance.now();
      this.#isAsked = false;
      this.#agreed = asked;
      this.#unanswered = [];
      this.#watch();
      // The subscription was changed since the attempt began.
      if (this.#subscription !== asked) this.#ask(true);
      this.#tell("open", "", null);
    }));
    socket.addEventListener("message", mine(({ data }) => this.#take(data)));
    // Comes before "close". Browsers do not say to a page what has happened; Node's packages may.
    socket.addEventListener("error", mine(({ message }) => (fault = message ? ` (${message})` : "")));
    socket.addEventListener("close", mine(({ code, reason }) => {
      const cause = wasOpen
        ? `the connection was lost (code ${code})`
        : `no connection: refused, or not there; see the server's log${fault}`;
      this.#lose(reason || (code === 1000 ? "closed by the server" : cause));
    }));
    this.#tell("connecting", "", null);
  }

  /**
   * A connection that breaks without notice is silent for ever, and browsers do not report the server's
   * pings. Timers are late on a hidden page and on a device that slept, so a server is not given up before it
   * was asked to answer.
   */
  #watch() {
    const left_ms = this.#heardAt + PATIENCE_MS - performance.now();
    if (left_ms <= 0 && this.#isAsked) {
      this.#leave("the server is silent", "silent");
      return;
    }
    if (left_ms <= 0) {
      this.#heardAt = performance.now();
      this.#isAsked = true;
      this.#ask(false);
    }
    this.#timer = setTimeout(() => this.#watch(), left_ms > 0 ? left_ms : PATIENCE_MS);
  }

  #take(data) {
    this.#heardAt = performance.now();
    this.#isAsked = false;
    try {
      if (typeof data !== "string") {
        this.#emit("list", decodeBinary(data));
        return;
      }
      const message = parsed(data);
      if ("lights" in message) this.#emit("list", read(message));
      else this.#answered(message);
    } catch (error) {
      this.#leave(error.message, "unreadable message");
      this.#emit("fault", error);
    }
  }

  #answered(message) {
    const { subscription, isTold } = this.#unanswered.shift() ?? { subscription: this.#agreed, isTold: true };
    if (!("error" in message)) this.#agreed = subscription;
    else if (this.#subscription === subscription) this.#subscription = this.#agreed;
    if (isTold) this.#emit("answer", message);
  }

  /** Closes a connection that is of no more use, with a reason for the server, and connects again. */
  #leave(reason, word) {
    const socket = this.#socket;
    this.#lose(reason);
    socket.close(4000, word);
  }

  /** The connection was closed by the other side: tries again after a wait, which grows with every loss. */
  #lose(reason) {
    // A connection that lasted shows that the server accepts this client.
    if (this.#state.state === "open" && performance.now() - this.#openedAt > this.#delays.max) this.#attempts = 0;
    this.#socket = null;
    clearTimeout(this.#timer);
    const longest = Math.min(this.#delays.max, this.#delays.min * 2 ** this.#attempts);
    // Half of the wait is random, so that the clients of a restarted server do not all reconnect at the same
    // time.
    const delay = longest * (0.5 + 0.5 * Math.random());
    this.#attempts = Math.min(this.#attempts + 1, 32);
    this.#timer = setTimeout(() => this.#attempt(), delay);
    this.#tell("closed", reason, delay);
  }

  #forget() {
    clearTimeout(this.#timer);
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  #tell(state, reason, retry_ms) {
    this.#state = { state, reason, retry_ms };
    this.#emit("state", this.#state);
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
