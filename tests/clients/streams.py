"""The stream against a server in this process."""

import contextlib
import http
import json
import logging
import struct
import threading
import time
import unittest

from golden import BIN, ROOT, TEXT
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

import lightcast

ADDRESSES = json.loads((ROOT / "tests/clients/addresses.json").read_text())


class Server:
    """A server that keeps what clients ask it and does with each what it is told; in a thread of its own."""

    def __init__(self, *handlers, status=None, why="not today\n"):
        """`handlers` are called in turn with a connection, the last of them again and again.

        `status` refuses all, and says `why`.
        """
        self.handlers, self.status, self.why = list(handlers), status, why
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
        self.url = f"ws://127.0.0.1:{self.server.socket.getsockname()[1]}/ws"
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
            return connection.respond(self.status, self.why)
        return None

    def _handle(self, connection):
        handler = self.handlers.pop(0) if len(self.handlers) > 1 else self.handlers[0]
        try:
            handler(connection)
        except ConnectionClosed:
            pass  # the client has what it wanted
        except Exception as fault:
            self.fault = fault


class Late(Server):
    """A server that answers a client when it is let."""

    def __init__(self, *handlers):
        super().__init__(*handlers)
        self.asked, self.answers = threading.Event(), threading.Event()

    def _request(self, connection, request):
        self.asked.set()
        self.answers.wait(10)
        return super()._request(connection, request)


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
                next(lightcast.Stream(f"ws://127.0.0.1:{server.socket.getsockname()[1]}"))
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

    def test_close_while_it_connects_ends_the_iteration(self):
        def silent(connection):
            connection.recv()

        for handler in (silent, send_from(0)):
            with Late(handler) as server:
                stream, got = lightcast.Stream(server.url), []
                reader = threading.Thread(target=lambda: got.extend(stream), daemon=True)
                reader.start()
                self.assertTrue(server.asked.wait(10))
                stream.close()
                server.answers.set()
                reader.join(10)
                self.assertEqual((reader.is_alive(), got), (False, []))

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

    def test_addresses_are_those_that_the_command_watch_takes(self):
        for whose in ("everyone takes", "only the clients take"):
            for given, expected in ADDRESSES[whose]:
                self.assertEqual(lightcast.Stream(given)._url.geturl(), expected)
        for given in [*ADDRESSES["nobody takes"], "ws://studio:99999", "ws://studio:0", "studio:0", " studio:7300\n"]:
            with self.subTest(given), self.assertRaises(ValueError) as caught:
                lightcast.Stream(given)
            wanted = f"{given!r} is no address of a server, such as ws://127.0.0.1:7300"
            self.assertEqual(str(caught.exception), wanted)
        with Server(send_from(3)) as server, lightcast.Stream(server.url[len("ws://") : -len("/ws")]) as stream:
            self.assertEqual(next(stream).sequence, 3)
            self.assertEqual([request.path for request in server.requests], ["/ws"])

    def test_the_reason_of_a_refusal_is_one_line_that_a_terminal_can_show(self):
        with Server(send_from(0), status=http.HTTPStatus.FORBIDDEN, why="\x1b[2Jnot from\there\nsecond\n") as server:
            with self.assertRaises(lightcast.Refused) as caught:
                next(lightcast.Stream(server.url))
            self.assertEqual(str(caught.exception), "the server answers with status 403: [2Jnot fromhere")
        with Server(send_from(0), status=http.HTTPStatus.FORBIDDEN, why="") as server:
            with self.assertRaises(lightcast.Refused) as caught:
                next(lightcast.Stream(server.url))
            self.assertEqual(str(caught.exception), "the server answers with status 403: Forbidden")
        logging.disable(logging.NOTSET)
        full = Server(send_from(9), status=http.HTTPStatus.SERVICE_UNAVAILABLE, why="all slots are taken\n")
        with full as server, lightcast.Stream(server.url) as stream, self.assertLogs(lightcast.LOG) as logged:
            opener = threading.Timer(0.3, setattr, (server, "status", None))
            opener.start()
            next(stream)
            opener.join()
        self.assertIn("the server answers with status 503: all slots are taken; next attempt in", logged.output[0])

    def test_arguments_that_no_server_takes_are_told_at_once(self):
        url = "ws://localhost:7300/ws"
        for keys in (
            {"lights": 0},
            {"lights": 16_385},
            {"lights": 1.5},
            {"queue": 65},
            {"error": 0.0},
            {"rate_hz": -1},
        ):
            with self.assertRaises(ValueError) as caught:
                lightcast.Stream(url, **keys)
            self.assertIn(next(iter(keys)), str(caught.exception))
            self.assertRaises(ValueError, lightcast.Stream(url).subscribe, **keys)
