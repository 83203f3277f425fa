/**
 * The client for Node, which before version 22 has no WebSocket: there it takes that of the package `ws`, and loads
 * it nowhere else. `import ... from "lightcast"` is this file in Node, and lightcast.js in browsers.
 */

import { createRequire } from "node:module";
import { LightcastClient as Client } from "./lightcast.js";

export { BINARY, JSON_TEXT, decodeBinary, decodeJson, directionIn } from "./lightcast.js";

const WebSocket = globalThis.WebSocket ?? ofPackage();

/** Undefined where there is none: the decoders need no package, and the client says what is missing. */
function ofPackage() {
  // A folder that npm has only linked is without its packages; the program that runs may have them.
  for (const from of [import.meta.url, process.argv[1]]) {
    try {
      if (from !== undefined) return createRequire(from)("ws");
    } catch (error) {
      if (error.code !== "MODULE_NOT_FOUND") throw error;
    }
  }
  return undefined;
}

/** A connection that is restored when it is lost; lightcast.js describes it. */
export class LightcastClient extends Client {
  constructor(url, options = {}) {
    super(url, { WebSocket, ...options });
  }
}
