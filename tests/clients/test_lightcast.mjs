// Tests of clients/lightcast.js:
//
//     node tests/clients/test_lightcast.mjs

import "./decoders.mjs";
import "./connections.mjs";
