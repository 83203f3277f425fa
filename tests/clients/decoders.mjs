// The decoders of clients/lightcast.js against the golden message, sound and damaged.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { decodeBinary, decodeJson, directionIn } from "../../clients/lightcast.js";

const golden = (name) => readFileSync(new URL(`../golden/${name}`, import.meta.url));
export const BIN = new Uint8Array(golden("message.bin"));
export const TEXT = golden("message.json").toString();

/** What every fault of a message begins with. */
const OWN = /^the message is no light list: /;

/** Decodes bytes that may lie in the middle of a buffer. */
const decode = (bytes) => decodeBinary(new Uint8Array(bytes).buffer);

/** A copy with other bytes from a place on. */
function patched(at, ...bytes) {
  const copy = BIN.slice();
  copy.set(bytes, at);
  return copy;
}

/** A copy with another f32 or f64 at a place. */
function withNumber(at, bits, value) {
  const copy = BIN.slice();
  const view = new DataView(copy.buffer);
  if (bits === 32) view.setFloat32(at, value, true);
  else view.setFloat64(at, value, true);
  return copy;
}

/** The same keys and values, numbers as near as an f32's digits allow. */
function same(found, expected, place) {
  if (typeof expected === "number") {
    assert.ok(Math.abs(found - expected) <= 2e-7 * Math.abs(expected), `${place}: ${found} is not ${expected}`);
  } else if (expected !== null && typeof expected === "object") {
    assert.deepEqual(Object.keys(found), Object.keys(expected), place);
    for (const key of Object.keys(expected)) same(found[key], expected[key], `${place}.${key}`);
  } else {
    assert.equal(found, expected, place);
  }
}

test("both golden messages are what the JSON says", () => {
  const expected = JSON.parse(TEXT);
  assert.equal(expected.lights.length, 12);
  same(decodeJson(TEXT), expected, "json");
  same(decode(BIN), expected, "binary");
});

test("suns stand where Blender and three.js show them in the panorama", () => {
  // Where their environment textures look for a direction: u from the left, v from below.
  const mappings = {
    blender: ([x, y, z]) => [0.5 - Math.atan2(y, x) / (2 * Math.PI), 0.5 + Math.atan2(z, Math.hypot(x, y)) / Math.PI],
    three: ([x, y, z]) => [0.5 + Math.atan2(z, x) / (2 * Math.PI), 0.5 + Math.asin(y) / Math.PI],
  };
  for (const { u, v, direction } of JSON.parse(readFileSync(new URL("suns.json", import.meta.url)))) {
    assert.deepEqual(directionIn(direction, "world"), direction);
    for (const [axes, mapping] of Object.entries(mappings)) {
      const found = mapping(directionIn(direction, axes));
      assert.ok(Math.abs(found[0] - u) < 1e-12 && Math.abs(found[1] - v) < 1e-12, `${axes} ${u} ${v}: ${found}`);
    }
  }
  for (const axes of ["unity", "toString", undefined]) {
    const message = `axes: "${axes}" is not known; give one of world, blender, three`;
    assert.throws(() => directionIn([0, 1, 0], axes), { message });
  }
});

test("numbers of the golden message", () => {
  const { sequence, lost_before, lights, stream } = decode(BIN);
  assert.deepEqual([sequence, lost_before, stream.lost], [2 ** 32 + 17, 2, 3]);
  assert.deepEqual(lights[4].irradiance, [0, 0, 0]);
  assert.equal(lights[11].id, 65535);
  assert.ok(Math.abs(lights[1].direction[1] + 1) < 1e-12);
});

test("flags that are unknown and a longer header are passed over", () => {
  const { stream } = decode(patched(6, 0xfe));
  assert.deepEqual([stream.capture_monotonic_ns, stream.capture_utc_ns], [null, null]);
  assert.equal(stream.sent_monotonic_ns, 86_400_135_802_467);
  const longer = new Uint8Array(BIN.length + 13).fill(255);
  longer.set(patched(4, 133).subarray(0, 120));
  longer.set(BIN.subarray(120), 133);
  assert.deepEqual(decode(longer), decode(BIN));
});

test("faults in bytes are told", () => {
  for (const [bytes, expected] of [
    [patched(0, 0x6c), "byte 0: does not begin with LCL"],
    [patched(3, 2), "byte 3: is of version 2"],
    [patched(4, 0x77), "byte 4: a header of 119 bytes"],
    [patched(4, 0x79), "has 328 bytes; with 5 prefix errors and 12 lights it would have 329"],
    [patched(116, 65), "byte 116: 65 prefix errors"],
    [patched(118, 1, 0x40), "byte 118: 16385 lights"],
    [patched(118, 13), "has 328 bytes"],
    [withNumber(72, 64, Infinity), "frame_rate_hz: "],
    [withNumber(72, 64, -25), "frame_rate_hz: "],
    [withNumber(88, 64, NaN), "power: "],
    [withNumber(80, 64, -1), "power: "],
    [withNumber(96, 64, 1.1e36), "power: "],
    [withNumber(108, 32, -0.5), "error: "],
    [withNumber(108, 32, Infinity), "error: "],
    [withNumber(112, 32, 1.1e30), "byte 112: the brightest"],
    [withNumber(112, 32, NaN), "byte 112: the brightest"],
    [withNumber(124, 32, NaN), "prefix_errors: "],
    [withNumber(124, 32, -0.25), "prefix_errors: "],
    [patched(174, 0, 0), "light 1: a light before it has the id 0"],
  ]) {
    assert.throws(() => decode(bytes), (error) => OWN.test(error.message) && error.message.includes(expected), expected);
  }
  for (let length = 0; length < BIN.length; length++) {
    assert.throws(() => decode(BIN.subarray(0, length)), { message: OWN });
  }
});

test("faults in JSON are told", () => {
  const prefixes = JSON.stringify(new Array(65).fill([1, 0.5]));
  for (const [wanted, replacement, expected] of [
    ['"version":1', '"version":2', "version: is not 1"],
    ['"version":1', '"version":{"toString":1}', "version: is not 1"],
    ['"sequence":4294967313', '"sequence":-1', "sequence: "],
    ['"sequence":4294967313,', "", "sequence: "],
    ['"frame_rate_hz":29.97', '"frame_rate_hz":-29.97', "frame_rate_hz: "],
    ['"frame_rate_hz":29.97', '"frame_rate_hz":NaN', "is no JSON: "],
    ['"frame_rate_hz":29.97', '"frame_rate_hz":"25"', "frame_rate_hz: "],
    ['"error":0.0031', '"error":1e999', "error: "],
    ['"error":0.0031', '"error":-0.0031', "error: "],
    ['"prefix_errors":[[1,0.5]', '"prefix_errors":[[1]', "prefix_errors: "],
    ['"prefix_errors":[[1,0.5]', '"prefix_errors":[[1,-0.5]', "prefix_errors: "],
    [/"prefix_errors":\[\[.*?\]\]/, `"prefix_errors":${prefixes}`, "prefix_errors: 65 of them"],
    [/"power":\[[^,]*/, '"power":["1"', "power: "],
    ["[0.0,-1.0,0.0]", "[0.0,-1.1,0.0]", "light 1: its direction"],
    ["[0.0,-1.0,0.0]", "[0.0,-1.0]", "light 1: its direction"],
    ['"spread_rad":3.1415927', '"spread_rad":3.15', "light 1: its spread_rad"],
    ['"spread_rad":3.1415927', '"spread_rad":"3"', "light 1: its spread_rad"],
    ["[0.0,0.0,0.0]", "[0.0,0.0,-1.0]", "light 4: its irradiance"],
    ['"id":65535', '"id":0', "light 11: a light before it has the id 0"],
    ['"id":65535', '"id":4294967296', "light 11: its id"],
    ['"lights":[', '"lights":[5,', "light 0: is no object"],
    ['"stream":{', '"river":{', "stream: is no object"],
    ['"lost":3', '"lost":-3', "stream.lost: "],
  ]) {
    const text = TEXT.replace(wanted, replacement);
    assert.notEqual(text, TEXT, expected);
    assert.throws(() => decodeJson(text), (error) => OWN.test(error.message) && error.message.includes(expected), expected);
  }
  const lights = `{"version":1,"lights":[${"0,".repeat(16384)}0]}`;
  for (const text of ["", "[]", "5", "null", "[".repeat(100_000), `${TEXT}}`, " ".repeat(2 ** 23) + TEXT, lights]) {
    assert.throws(() => decodeJson(text), { message: OWN });
  }
});

/** Numbers from 0 to 1, the same ones every time: a linear congruential generator, of which the high bits are used. */
function generator(seed) {
  return () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 2 ** 32;
  };
}

test("damaged messages give nothing but the decoders' own errors", () => {
  const random = generator(5);
  const below = (end) => Math.floor(random() * end);
  const signs = [...'0123456789-.e,"[]{}'].map((sign) => sign.charCodeAt(0));
  const decoders = [
    [decode, BIN],
    [(bytes) => decodeJson(Buffer.from(bytes).toString()), new TextEncoder().encode(TEXT)],
  ];
  for (const [read, message] of decoders) {
    let sound = 0;
    let refused = 0;
    for (let round = 0; round < 5000; round++) {
      const damaged = [...message];
      for (let faults = 1 + below(3); faults > 0; faults--) {
        const at = below(damaged.length);
        if (random() < 0.2) damaged.splice(at, 1 + below(20));
        else damaged[at] = random() < 0.5 ? signs[below(signs.length)] : below(256);
      }
      try {
        read(damaged);
        sound++;
      } catch (error) {
        assert.match(error.message, OWN, error.stack);
        refused++;
      }
    }
    assert.ok(sound > 0 && refused > 0, `${sound} sound, ${refused} refused`);
  }
});
