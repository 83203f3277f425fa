"""Tests of clients/lightcast.py: its decoders against the golden message, its stream against a server in this process.

    python tests/clients/test_lightcast.py
    python tests/clients/test_lightcast.py --url ws://127.0.0.1:8080/ws --count 10 [--token T] [--json] [--lights 8 ...]

With --url it connects to a running server instead and prints a line of JSON for each of --count lists.
"""

import argparse
import contextlib
import faulthandler
import http
import json
import logging
import math
import random
import struct
import sys
import threading
import time
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients"))

import lightcast  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402
from websockets.sync.server import serve  # noqa: E402

BIN = (ROOT / "tests/golden/message.bin").read_bytes()
TEXT = (ROOT / "tests/golden/message.json").read_text()


class Decoders(unittest.TestCase):
    def close(self, got, wanted):
        self.assertEqual(len(got), len(wanted))
        for one, other in zip(got, wanted):
            # Between what numbers of 32 bits are in the one and in the other.
            self.assertTrue(math.isclose(one, other, rel_tol=2e-7, abs_tol=1e-7 * abs(other)), f"{got} {wanted}")

    def test_both_golden_messages_are_the_same_list(self):
        binary, text = lightcast.decode_binary(BIN), lightcast.decode_json(TEXT)
        self.assertEqual(len(binary.lights), 12)
        for one, other in zip(binary.lights, text.lights):
            self.assertEqual(one.id, other.id)
            self.assertTrue(all(abs(a - b) < 1e-7 for a, b in zip(one.direction, other.direction)), f"{one} {other}")
            self.close(one.irradiance, other.irradiance)
            self.close([one.spread_rad], [other.spread_rad])
        self.close([binary.error], [text.error])
        self.assertEqual([count for count, _ in binary.prefix_errors], [1, 2, 4, 8, 12])
        for one, other in zip(binary.prefix_errors, text.prefix_errors):
            self.close(one, other)
        for name in vars(text):
            if name not in ("lights", "error", "prefix_errors"):
                self.assertEqual(getattr(binary, name), getattr(text, name), name)

    def test_golden_numbers(self):
        lights = lightcast.decode_binary(BIN)
        self.assertEqual((lights.sequence, lights.lost, lights.lost_before), ((1 << 32) + 17, 3, 2))
        self.assertEqual((lights.frame_rate_hz, lights.filter_delay_frames), (29.97, 4))
        self.assertEqual(lights.capture_utc_ns, 1_795_000_000_123_456_789)
        self.assertEqual(lights.lights[1].direction, (0.0, -1.0, 0.0))
        self.assertEqual(lights.lights[4].irradiance, (0.0, 0.0, 0.0))
        self.assertEqual(lights.lights[11].id, 65_535)

    def test_age(self):
        lights = lightcast.decode_binary(BIN)
        lights.capture_utc_ns = time.time_ns() - 2_000_000_000
        lights.capture_monotonic_ns = time.monotonic_ns() - 1_000_000_000
        self.assertAlmostEqual(lights.age_s(), 2.0, delta=0.5)
        self.assertAlmostEqual(lights.age_s(same_machine=True), 1.0, delta=0.5)
        unknown = bytearray(BIN)
        unknown[6] = 0xFE  # flags that this version does not know, and not the one that it knows
        lights = lightcast.decode_binary(bytes(unknown))
        self.assertEqual((lights.capture_utc_ns, lights.capture_monotonic_ns, lights.age_s()), (None, None, None))
        self.assertEqual(lights.sent_monotonic_ns, 86_400_135_802_467)

    def test_a_longer_header_is_skipped(self):
        longer = BIN[:4] + struct.pack("<H", 133) + BIN[6:120] + b"\xff" * 13 + BIN[120:]
        self.assertEqual(lightcast.decode_binary(longer), lightcast.decode_binary(BIN))

    def test_faults_in_bytes_are_told(self):
        for byte, patch, expected in (
            (0, b"l", "byte 0: "),
            (3, b"\x02", "byte 3: the message is of version 2"),
            (4, b"\x77", "byte 4: "),
            (4, b"\x79", "the message has 328 bytes; with 5 prefix errors and 12 lights it has 329"),
            (116, b"\x41", "byte 116: 65 prefix errors"),
            (118, b"\x01\x40", "byte 118: 16385 lights"),
            (118, b"\x0d", "the message has 328 bytes"),
            (72, struct.pack("<d", math.inf), "byte 72: the frame rate is inf"),
            (88, struct.pack("<d", math.nan), "byte 88: the power is nan"),
            (80, struct.pack("<d", -1.0), "byte 80: the power is -1.0"),
            (108, struct.pack("<f", math.inf), "byte 108: the error is inf"),
            (112, struct.pack("<f", 1.1e30), "byte 112: the highest irradiance is 1.1"),
            (124, struct.pack("<f", math.nan), "byte 124: the error of a prefix is nan"),
            (174, b"\0\0", "byte 174: light 1 has the id 0 of another"),
        ):
            with self.subTest(expected), self.assertRaises(ValueError) as caught:
                lightcast.decode_binary(BIN[:byte] + patch + BIN[byte + len(patch) :])
            self.assertIn(expected, str(caught.exception))
        for length in range(len(BIN)):
            self.assertRaises(ValueError, lightcast.decode_binary, BIN[:length])

    def test_faults_in_json_are_told(self):
        for wanted, replacement, expected in (
            ('"version":1', '"version":2', "version: the list is of version 2"),
            ('"version":1', '"version":true', "version: missing, or no whole number"),
            ('"sequence":4294967313', '"sequence":-1', "sequence: missing, or no whole number from 0"),
            ('"sequence":4294967313,', "", "sequence: missing"),
            ('"frame_rate_hz":29.97', '"frame_rate_hz":NaN', "frame_rate_hz: missing, or no number"),
            ('"frame_rate_hz":29.97', '"frame_rate_hz":1' + "0" * 400, "frame_rate_hz: missing, or no number"),
            ('"error":0.0031', '"error":1e999', "error: missing, or no number"),
            ('"prefix_errors":[[1,0.5]', '"prefix_errors":[[1]', "prefix_errors: one is no pair"),
            ("[0.0,-1.0,0.0]", "[0.0,-1.1,0.0]", "lights: number 1: direction: no unit vector"),
            ("[0.0,-1.0,0.0]", "[0.0,-1.0]", "lights: number 1: direction: missing, or no array of 3"),
            ('"spread_rad":3.1415927', '"spread_rad":3.15', "lights: number 1: spread_rad: "),
            ('"spread_rad":3.1415927', '"spread_rad":"3"', "lights: number 1: spread_rad: "),
            ("[0.0,0.0,0.0]", "[0.0,0.0,-1.0]", "lights: number 4: irradiance: "),
            ('"id":65535', '"id":0', "lights: two have the same id"),
            ('"lights":[', '"lights":[5,', "lights: number 0 is no object"),
            ('"stream":{', '"river":{', "stream: missing"),
            ('"lost":3', '"lost":3.0', "lost: missing, or no whole number"),
        ):
            self.assertIn(wanted, TEXT)
            with self.subTest(expected), self.assertRaises(ValueError) as caught:
                lightcast.decode_json(TEXT.replace(wanted, replacement, 1))
            self.assertIn(expected, str(caught.exception))
        for text in ("", "[]", "5", "[" * 100_000, TEXT + "}", b"\xff" + TEXT.encode(), " " * (1 << 23) + TEXT):
            self.assertRaises(ValueError, lightcast.decode_json, text)
        self.assertEqual(lightcast.decode_json(TEXT.encode()), lightcast.decode_json(TEXT))

    def test_damaged_messages_raise_nothing_but_value_error(self):
        generator = random.Random(5)
        sound = 0
        for decode, message in ((lightcast.decode_binary, BIN), (lightcast.decode_json, TEXT.encode())):
            for _ in range(5000):
                damaged = bytearray(message)
                for _ in range(generator.randint(1, 3)):
                    at = generator.randrange(len(damaged))
                    if generator.random() < 0.2:
                        del damaged[at : at + generator.randint(1, 20)]
                    elif generator.random() < 0.5:
                        damaged[at] = generator.choice(b'0123456789-.e,"[]{}')
                    else:
                        damaged[at] = generator.randrange(256)
                with contextlib.suppress(ValueError):
                    sound += len(decode(bytes(damaged)).lights) > 0
        self.assertTrue(0 < sound < 10_000, sound)


class Server:
    """A server that keeps what clients ask it and does with each what it is told; in a thread of its own."""

    def __init__(self, *handlers, status=None):
        """`handlers` are called in turn with a connection, the last of them again and again; `status` refuses all."""
        self.handlers, self.status = list(handlers), status
        self.requests = []
        self.fault = None

    def __enter__(self):
        self.server = serve(
            self._handle,
            "127.0.0.1",
            0,
            subprotocols=[lightcast.BINARY, lightcast.JSON],
            process_request=self._request,
        )
        self.url = "ws://127.0.0.1:{}/ws".format(self.server.socket.getsockname()[1])
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.thread.join()
        if self.fault is not None:
            raise self.fault

    def _request(self, connection, request):
        self.requests.append(request)
        if self.status is not None:
            return connection.respond(self.status, "not today\n")
        return None

    def _handle(self, connection):
        handler = self.handlers.pop(0) if len(self.handlers) > 1 else self.handlers[0]
        try:
            handler(connection)
        except ConnectionClosed:
            pass  # the client has what it wanted
        except Exception as fault:
            self.fault = fault


def numbered(sequence):
    return BIN[:48] + struct.pack("<Q", sequence) + BIN[56:]


def send_from(first, count=None):
    """A handler that sends lists from a number on, so many or till the client has gone."""

    def handler(connection):
        with contextlib.suppress(ConnectionClosed):  # the client has what it wanted
            sequence = first
            while count is None or sequence < first + count:
                if connection.subprotocol == lightcast.JSON:
                    connection.send(TEXT.replace("4294967313", str(sequence)))
                else:
                    connection.send(numbered(sequence))
                sequence += 1

    return handler


class Streams(unittest.TestCase):
    def setUp(self):
        # Tests need not wait as long as users of a server that restarts.
        self.addCleanup(setattr, lightcast.Stream, "FIRST_WAIT_S", lightcast.Stream.FIRST_WAIT_S)
        lightcast.Stream.FIRST_WAIT_S = 0.01
        # What the client says of attempts, and the test's server of connections that end in the middle.
        logging.disable(logging.ERROR)
        self.addCleanup(logging.disable, logging.NOTSET)

    def test_lists_arrive_by_both_protocols(self):
        for binary, subprotocol in ((True, lightcast.BINARY), (False, lightcast.JSON)):
            with Server(send_from(7)) as server, lightcast.Stream(server.url, binary=binary) as stream:
                self.assertEqual([next(stream).sequence for _ in range(40)], list(range(7, 47)))
                (request,) = server.requests
                self.assertEqual(request.headers["Sec-WebSocket-Protocol"], subprotocol)
                self.assertEqual(request.path, "/ws")
                self.assertNotIn("Authorization", request.headers)

    def test_keys_and_token_are_sent(self):
        with Server(send_from(0)) as server:
            keys = {"lights": 64, "error": 0.02, "rate_hz": 12.5, "queue": 4}
            with lightcast.Stream(server.url + "?a=b", token="of ours", **keys) as stream:
                next(stream)
            (request,) = server.requests
            self.assertEqual(request.path, "/ws?a=b&lights=64&error=0.02&rate_hz=12.5&queue=4")
            self.assertEqual(request.headers["Authorization"], "Bearer of ours")

    def test_a_connection_that_is_lost_comes_back(self):
        def cut(connection):
            connection.send(numbered(3))
            connection.socket.shutdown(2)

        with Server(send_from(0, 3), cut, send_from(4)) as server, lightcast.Stream(server.url, lights=8) as stream:
            self.assertEqual([next(stream).sequence for _ in range(8)], list(range(8)))
            self.assertEqual([request.path for request in server.requests], ["/ws?lights=8"] * 3)

    def test_a_server_that_starts_later_is_found(self):
        with Server(send_from(0)) as server:
            url = server.url
        port = int(url.split(":")[2].split("/")[0])
        stream = lightcast.Stream(url)
        got = []
        reader = threading.Thread(target=lambda: got.append(next(stream).sequence))
        reader.start()
        time.sleep(0.3)
        self.assertTrue(reader.is_alive())
        with serve(send_from(5), "127.0.0.1", port, subprotocols=[lightcast.BINARY]) as late:
            thread = threading.Thread(target=late.serve_forever)
            thread.start()
            reader.join(10)
            stream.close()
            late.shutdown()
            thread.join()
        self.assertEqual(got, [5])

    def test_waits_double_up_to_the_longest_and_begin_anew_with_a_list(self):
        stream = lightcast.Stream("ws://127.0.0.1:1/ws")
        stream.FIRST_WAIT_S, stream.LONGEST_WAIT_S = 0.25, 10.0
        for longest_s in (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0):
            self.assertTrue(0.5 * longest_s <= stream._next_wait_s() <= longest_s)
        stream._attempts = 5000
        self.assertLessEqual(stream._next_wait_s(), 10.0)
        with Server(send_from(0)) as server, lightcast.Stream(server.url) as stream:
            stream._attempts = 3
            next(stream)
            self.assertEqual(stream._attempts, 0)

    def test_subscriptions_change_while_connected(self):
        said = []

        def handler(connection):
            connection.send(numbered(0))
            said.append(json.loads(connection.recv()))
            connection.send(json.dumps({"subscribed": said[-1]["subscribe"]}))
            connection.send(numbered(1))
            said.append(json.loads(connection.recv()))
            connection.send(json.dumps({"error": "lights: not so many"}))
            connection.send(numbered(2))
            # And goes: what was agreed upon is asked for again.

        with Server(handler, send_from(3)) as server, lightcast.Stream(server.url, rate_hz=5) as stream:
            self.assertEqual(next(stream).sequence, 0)
            stream.subscribe(lights=64, error=0.02)
            self.assertEqual(next(stream).sequence, 1)
            stream.subscribe(lights=65, queue=2)
            with self.assertRaises(lightcast.Refused) as caught:
                next(stream)
            self.assertIn("lights: not so many", str(caught.exception))
            self.assertEqual([next(stream).sequence for _ in range(2)], [2, 3])
            self.assertEqual(said[0], {"subscribe": {"lights": 64, "error": 0.02}})
            self.assertEqual(said[1], {"subscribe": {"lights": 65, "queue": 2}})
            paths = [request.path for request in server.requests]
            self.assertEqual(paths, ["/ws?rate_hz=5", "/ws?lights=64&error=0.02"])

    def test_what_the_server_refuses_is_raised_and_what_passes_is_waited_for(self):
        with Server(send_from(0), status=http.HTTPStatus.UNAUTHORIZED) as server:
            with self.assertRaises(lightcast.Refused) as caught:
                next(lightcast.Stream(server.url, token="secret"))
            self.assertEqual(str(caught.exception), "the server answers with status 401: not today")
            self.assertEqual(len(server.requests), 1)
        with serve(send_from(0), "127.0.0.1", 0) as server:  # speaks no subprotocol
            thread = threading.Thread(target=server.serve_forever)
            thread.start()
            with self.assertRaises(lightcast.Refused) as caught:
                next(lightcast.Stream("ws://127.0.0.1:{}".format(server.socket.getsockname()[1])))
            server.shutdown()
            thread.join()
        self.assertIn("does not speak lightcast.v1.bin", str(caught.exception))
        for status in (http.HTTPStatus.SERVICE_UNAVAILABLE, http.HTTPStatus.TOO_MANY_REQUESTS):
            with Server(send_from(9), status=status) as server, lightcast.Stream(server.url) as stream:
                opener = threading.Timer(0.3, setattr, (server, "status", None))
                opener.start()
                self.assertEqual(next(stream).sequence, 9)
                opener.join()
                self.assertGreater(len(server.requests), 2)

    def test_a_message_that_is_not_sound_is_told_and_the_next_is_read(self):
        def handler(connection):
            connection.send(BIN[:-1])
            connection.send("{")
            send_from(1)(connection)

        with Server(handler) as server, lightcast.Stream(server.url) as stream:
            self.assertRaises(ValueError, next, stream)
            self.assertRaises(ValueError, next, stream)
            self.assertEqual(next(stream).sequence, 1)

    def test_close_ends_the_iteration_also_from_another_thread(self):
        def silent(connection):
            connection.recv()

        with Server(silent) as server:
            stream = lightcast.Stream(server.url)
            closer = threading.Timer(0.3, stream.close)
            closer.start()
            self.assertEqual(list(stream), [])
            closer.join()
            self.assertEqual(list(stream), [])
        lightcast.Stream.FIRST_WAIT_S = 60.0
        stream = lightcast.Stream(server.url, lights=1)  # nobody there any more
        stream.LONGEST_WAIT_S = 60.0
        closer = threading.Timer(0.3, stream.close)
        closer.start()
        self.assertEqual(list(stream), [])
        closer.join()

    def test_a_slow_reader_leaves_lists_at_the_server(self):
        # With a header as long as can be, so that a hundred of them fill the buffers of all sockets.
        long = BIN[:4] + struct.pack("<H", 65_000) + BIN[6:120] + bytes(65_000 - 120) + BIN[120:]
        sent = []

        def handler(connection):
            while True:
                connection.send(long)
                sent.append(len(sent))

        with Server(handler) as server, lightcast.Stream(server.url) as stream:
            next(stream)
            time.sleep(0.5)
            in_half_a_second = len(sent)
            time.sleep(0.5)
            self.assertEqual(len(sent), in_half_a_second)
            next(stream)

    def test_arguments_that_no_server_takes_are_told_at_once(self):
        for url in ("", "http://localhost/ws", "ws:///ws", "localhost:8080", "ws://localhost:99999/ws"):
            self.assertRaises(ValueError, lightcast.Stream, url)
        url = "ws://localhost:8080/ws"
        for keys in ({"lights": 0}, {"lights": 16_385}, {"lights": 1.5}, {"queue": 65}, {"error": 0.0}, {"rate_hz": -1}):
            with self.assertRaises(ValueError) as caught:
                lightcast.Stream(url, **keys)
            self.assertIn(next(iter(keys)), str(caught.exception))
            self.assertRaises(ValueError, lightcast.Stream(url).subscribe, **keys)


def watch(arguments):
    """Prints a line for each list of a running server."""
    keys = {key: getattr(arguments, key) for key in ("lights", "error", "rate_hz", "queue")}
    with lightcast.Stream(arguments.url, token=arguments.token, binary=not arguments.json, **keys) as stream:
        for _ in range(arguments.count):
            lights = next(stream)
            line = {
                "sequence": lights.sequence,
                "lights": len(lights.lights),
                "power": lights.power,
                "lost": lights.lost,
                "age_s": lights.age_s(same_machine=True),
            }
            print(json.dumps(line), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], add_help=True)
    parser.add_argument("--url", help="connect to this server instead of testing")
    parser.add_argument("--count", type=int, default=1, help="lists to print")
    parser.add_argument("--token")
    parser.add_argument("--json", action="store_true", help="ask for JSON, not for bytes")
    parser.add_argument("--lights", type=int)
    parser.add_argument("--error", type=float)
    parser.add_argument("--rate-hz", type=float)
    parser.add_argument("--queue", type=int)
    parsed, rest = parser.parse_known_args()
    if parsed.url:
        watch(parsed)
    else:
        # A test that hangs says where.
        faulthandler.dump_traceback_later(120, exit=True)
        unittest.main(argv=[sys.argv[0], *rest])
