// The client of clients/lightcast.js against a WebSocket and a clock that these tests have in hand.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { LightcastClient } from "../../clients/lightcast.js";
import { BIN } from "./decoders.mjs";

const SUBSCRIBED = JSON.stringify({ subscribed: {} });

/** Timers and a clock that stand until they are told. */
class Clock {
  now_ms = 0;
  #timers = new Map();
  #last = 0;

  set(act, wait_ms) {
    this.#timers.set(++this.#last, { act, due_ms: this.now_ms + wait_ms });
    return this.#last;
  }

  clear(id) {
    this.#timers.delete(id);
  }

  get waiting() {
    return this.#timers.size;
  }

  /** Does what is due until then, in order. */
  advance(by_ms) {
    const end_ms = this.now_ms + by_ms;
    for (;;) {
      const [next] = [...this.#timers].sort(([, a], [, b]) => a.due_ms - b.due_ms);
      if (next === undefined || next[1].due_ms > end_ms) break;
      this.#timers.delete(next[0]);
      this.now_ms = Math.max(this.now_ms, next[1].due_ms);
      next[1].act();
    }
    this.now_ms = end_ms;
  }
}

/** What the client takes for a WebSocket. */
class Socket extends EventTarget {
  sent = [];
  closed = null;

  constructor(url, protocols) {
    super();
    if (url.startsWith("ws://forbidden/")) throw new DOMException("not from this page", "SecurityError");
    Object.assign(this, { url, protocols });
    Socket.all.push(this);
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  close(code) {
    this.closed = code ?? 1000;
  }

  open() {
    this.dispatchEvent(new Event("open"));
  }

  message(data) {
    this.dispatchEvent(Object.assign(new Event("message"), { data }));
  }
}

/** Node 18 lacks it, and a WebSocket too: there the decoders are for whoever brings a connection. */
const NO_EVENTS = typeof CustomEvent === "undefined" && "this Node has no CustomEvent";

/** Runs a test of a client with the clock and the sockets, and what it has told. */
function withClient(name, act, url = "ws://here/ws") {
  test(name, { skip: NO_EVENTS }, () => {
    const clock = new Clock();
    const replaced = {
      WebSocket: Socket,
      performance: { now: () => clock.now_ms },
      setTimeout: (act, wait_ms) => clock.set(act, wait_ms),
      clearTimeout: (id) => clock.clear(id),
    };
    const before = Object.entries(replaced).map(([key]) => [key, Object.getOwnPropertyDescriptor(globalThis, key)]);
    for (const [key, value] of Object.entries(replaced)) {
      Object.defineProperty(globalThis, key, { value, configurable: true, writable: true });
    }
    try {
      Socket.all = [];
      const client = new LightcastClient(url, { subscription: { lights: 8 } });
      const told = [];
      for (const type of ["list", "state", "answer", "fault"]) {
        client.addEventListener(type, ({ detail }) => told.push([type, type === "state" ? detail.state : detail]));
      }
      act({ client, clock, told, kinds: () => told.splice(0).map(([type, detail]) => (type === "state" ? detail : type)) });
    } finally {
      for (const [key, descriptor] of before) {
        if (descriptor === undefined) delete globalThis[key];
        else Object.defineProperty(globalThis, key, descriptor);
      }
    }
  });
}

withClient("a silent server is asked, and given up when it does not answer", ({ client, clock, kinds }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  socket.message(BIN.buffer.slice(0));
  assert.deepEqual(kinds(), ["connecting", "open", "list"]);
  clock.advance(9_999);
  assert.deepEqual(socket.sent, []);
  clock.advance(1);
  assert.deepEqual(socket.sent, [{ subscribe: { lights: 8 } }]);
  clock.advance(9_999);
  assert.deepEqual([socket.sent.length, socket.closed, Socket.all.length], [1, null, 1]);
  clock.advance(1);
  assert.deepEqual([socket.sent.length, socket.closed, client.state.reason], [1, 4000, "the server is silent"]);
  assert.deepEqual(kinds(), ["closed"]);
  // What it still says is not heard, and it comes again.
  socket.message(SUBSCRIBED);
  clock.advance(250);
  assert.equal(Socket.all.length, 2);
  Socket.all[1].open();
  assert.deepEqual(kinds(), ["connecting", "open"]);
});

withClient("a server that has no lists is asked every ten seconds, and nobody is told", ({ client, clock, kinds }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  kinds();
  for (let count = 1; count <= 20; count++) {
    clock.advance(10_000);
    assert.equal(socket.sent.length, count);
    socket.message(SUBSCRIBED);
  }
  assert.deepEqual([kinds(), socket.closed], [[], null]);
  // An answer to what was asked for is told, one to the question that went before it is not.
  clock.advance(10_000);
  client.subscribe({ lights: 4 });
  socket.message(SUBSCRIBED);
  assert.deepEqual(kinds(), []);
  socket.message(SUBSCRIBED);
  assert.deepEqual(kinds(), ["answer"]);
});

withClient("a server that sends lists is not asked", ({ client, clock, kinds }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  for (let count = 0; count < 100; count++) {
    clock.advance(9_000);
    socket.message(BIN.buffer.slice(0));
  }
  assert.deepEqual([socket.sent, socket.closed], [[], null]);
  assert.equal(kinds().filter((kind) => kind === "list").length, 100);
});

withClient("timers that come late give nobody up who was not asked", ({ client, clock }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  clock.now_ms += 3_600_000;
  clock.advance(0);
  assert.deepEqual([socket.sent.length, socket.closed], [1, null]);
  socket.message(SUBSCRIBED);
  clock.advance(9_999);
  assert.deepEqual([socket.sent.length, socket.closed], [1, null]);
});

withClient("what the server does not take is not asked for again", ({ client, clock, told }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  client.subscribe({ lights: 4 });
  socket.message(SUBSCRIBED);
  client.subscribe({ lights: -1 });
  socket.message(JSON.stringify({ error: "lights: at least 1" }));
  assert.deepEqual(told.at(-1), ["answer", { error: "lights: at least 1" }]);
  assert.deepEqual(client.subscription, { lights: 4 });
  clock.advance(20_000);
  assert.deepEqual(socket.sent.at(-1), { subscribe: { lights: 4 } });
  clock.advance(250);
  assert.equal(Socket.all[1].url, "ws://here/ws?lights=4");
});

withClient("a message that cannot be read ends the connection, which comes again", ({ client, clock, kinds }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  socket.message(BIN.buffer.slice(0, 50));
  assert.deepEqual([kinds(), socket.closed], [["connecting", "open", "closed", "fault"], 4000]);
  clock.advance(250);
  assert.equal(Socket.all.length, 2);
});

withClient("a client that is closed waits for nothing", ({ client, clock, kinds }) => {
  client.connect();
  const [socket] = Socket.all;
  socket.open();
  client.close();
  assert.deepEqual([socket.closed, clock.waiting, client.state.retry_ms], [1000, 0, null]);
  assert.deepEqual(kinds(), ["connecting", "open", "closed"]);
});

withClient(
  "an address that this page may not call is told as a state",
  ({ client, clock }) => {
    client.connect();
    assert.deepEqual(client.state, { state: "closed", reason: "not from this page", retry_ms: null });
    assert.equal(clock.waiting, 0);
  },
  "ws://forbidden/ws",
);

withClient("where there is no WebSocket, the client says so and takes the one that it is given", ({ client }) => {
  delete globalThis.WebSocket;
  client.connect();
  assert.match(client.state.reason, /^no WebSocket here; before Node 22 the package ws has one/);
  assert.equal(client.state.retry_ms, null);
  const given = new LightcastClient("here:7300", { WebSocket: Socket });
  given.connect();
  assert.deepEqual([given.state.state, Socket.all[0].url], ["connecting", "ws://here:7300/ws"]);
});

withClient("what a browser does not say of a refusal, the server's log does", ({ client, clock }) => {
  client.connect();
  const fail = (socket, event) => {
    socket.dispatchEvent(event);
    socket.dispatchEvent(Object.assign(new Event("close"), { code: 1006, reason: "" }));
  };
  const advice = "no connection: refused, or not there; see the server's log";
  fail(Socket.all[0], new Event("error"));
  assert.deepEqual([client.state.state, client.state.reason], ["closed", advice]);
  clock.advance(250);
  fail(Socket.all[1], Object.assign(new Event("error"), { message: "Unexpected server response: 403" }));
  assert.equal(client.state.reason, `${advice} (Unexpected server response: 403)`);
  // A connection that was there is lost.
  clock.advance(500);
  Socket.all[2].open();
  fail(Socket.all[2], new Event("error"));
  assert.equal(client.state.reason, "the connection was lost (code 1006)");
});

const ADDRESSES = JSON.parse(readFileSync(new URL("addresses.json", import.meta.url)));
for (const [given, expected] of [...ADDRESSES["everyone takes"], ...ADDRESSES["only the clients take"]]) {
  const url = new URL(expected);
  url.searchParams.set("lights", "8");
  withClient(`the address ${given}`, ({ client }) => {
    client.connect();
    assert.equal(Socket.all[0].url, url.href);
  }, given);
}

test("what is no address is refused", { skip: NO_EVENTS }, () => {
  for (const given of [...ADDRESSES["nobody takes"], "ws://studio:99999", "ws://studio:0", "studio:0", " studio:7300\n"]) {
    const message = `"${given}" is no address of a server, such as ws://127.0.0.1:7300`;
    assert.throws(() => new LightcastClient(given), { message });
  }
});
