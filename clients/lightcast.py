"""Lists of directional lights from a lightcast server, as they arrive.

    pip install ./clients       (or copy this file, and: pip install "websockets>=15")

    import lightcast

    for lights in lightcast.Stream("127.0.0.1:7300", lights=64):
        print(lights.sequence, lights.power, lights.age_s())

`Stream` connects, and connects again when the connection is lost; `decode_binary` and `decode_json` take single
messages apart. The protocol is described in lightcast's docs/protocol.md. Directions are unit vectors towards the
light, right-handed, +Y up, the centre of a panorama +Z and left of it +X; `Light.direction_in` turns them for other
programs. The irradiance of a light is that of a surface which faces it, linear Rec. 709.

Needs Python 3.9 and the package `websockets` from version 15 on.
"""

import contextlib
import dataclasses
import json
import logging
import math
import random
import re
import ssl
import struct
import sys
import threading
import time
import urllib.parse
from typing import NamedTuple, Optional, Union

from websockets.exceptions import InvalidStatus, InvalidURI, NegotiationError, WebSocketException
from websockets.http11 import Response
from websockets.sync.client import connect

JSON = "lightcast.v1.json"
BINARY = "lightcast.v1.bin"

# Limits of messages; the server sends none that exceeds them.
MOST_BYTES = 1 << 23
MOST_LIGHTS = 16_384
MOST_PREFIX_ERRORS = 64
MOST_IRRADIANCE = 1e30
MOST_POWER = 1e36
MOST_ERROR = 3.5e38
MOST_RATE_HZ = sys.float_info.max
MOST_QUEUED = 64

LOG = logging.getLogger(__name__)


class Refused(Exception):
    """The server said no, and would say it again: wrong token, wrong address, a subscription that it does not take."""


class Light(NamedTuple):
    """One directional light."""

    id: int
    """Slot of the light: the same light from list to list."""
    direction: tuple[float, float, float]
    """Unit vector towards the light."""
    irradiance: tuple[float, float, float]
    """Red, green, blue, on a surface that faces the light."""
    spread_rad: float
    """RMS angle in radians of what the light stands for about its direction; 0 where it is unknown."""

    def direction_in(self, axes: str) -> tuple[float, float, float]:
        """The direction by the axes of "blender" (+Z up) or "three" (three.js), so that the light stands where that
        program shows it in the same panorama; "world" gives it as it is. Raises ValueError for other names.
        """
        x, y, z = self.direction
        directions = {"world": (x, y, z), "blender": (z, x, y), "three": (z, y, -x)}
        if axes not in directions:
            raise ValueError(f"axes: {axes!r} is not known; give one of {', '.join(directions)}")
        return directions[axes]


@dataclasses.dataclass
class List:
    """The lights of one frame."""

    sequence: int
    """Number of the frame, as its source counts."""
    capture_time_ns: int
    """When the frame was captured, by the clock of its source: a replay starts at 0."""
    lost_before: int
    """Frames lost between the list before and this one, by the source or on the way through the server."""
    frame_rate_hz: float
    """Nominal rate of the source."""
    filter_delay_frames: int
    """The lights are those of so many frames before."""
    power: tuple[float, float, float]
    """Sum of the irradiances of all lights, also of those that a shorter list has joined to others."""
    error: float
    """Relative RMS error of the irradiances over all normals."""
    prefix_errors: list[tuple[int, float]]
    """The same error when only the first n lights are asked for: pairs of n and error."""
    lights: list[Light]
    """All lights, also the dark ones."""
    lost: int
    """Lists that this client should have had since the last one and was too slow for."""
    capture_monotonic_ns: Optional[int]
    """When the frame was captured, by the server's CLOCK_MONOTONIC; None for a replay as fast as it goes."""
    capture_utc_ns: Optional[int]
    """The same in UTC, since 1970."""
    sent_monotonic_ns: int
    """When the list was sent, by the server's CLOCK_MONOTONIC."""
    sent_utc_ns: int
    """The same in UTC, since 1970."""

    def age_s(self, same_machine: bool = False) -> Optional[float]:
        """Seconds since the frame was captured; None where that is unknown.

        By UTC, which is as exact as the two machines agree about it; by CLOCK_MONOTONIC on the machine of the server.
        The lights are older by `filter_delay_frames / frame_rate_hz`.
        """
        if self.capture_monotonic_ns is None or self.capture_utc_ns is None:
            return None
        if same_machine:
            return (time.monotonic_ns() - self.capture_monotonic_ns) * 1e-9
        return (time.time_ns() - self.capture_utc_ns) * 1e-9


# --- Messages as bytes --------------------------------------------------------------------------------------

_HEADER = struct.Struct("<3sBHHQqqqqQqQd3dIffHH")
_PREFIX = struct.Struct("<If")
_LIGHT = struct.Struct("<7H")
_HAS_CAPTURE_TIMES = 1


def decode_binary(message: bytes) -> List:
    """Takes a binary message apart. Raises ValueError, which names the byte, where it is not sound."""
    if message[:3] != b"LCL":
        raise ValueError("byte 0: the message does not begin with LCL: it is no light list")
    if len(message) > 3 and message[3] != 1:
        raise ValueError(f"byte 3: the message is of version {message[3]}; this client reads version 1")
    if len(message) < _HEADER.size:
        raise ValueError(f"byte {len(message)}: the message ends in its header of {_HEADER.size} bytes")
    (_, _, header_bytes, flags, lost, capture_monotonic_ns, capture_utc_ns, sent_monotonic_ns, sent_utc_ns, sequence,
     capture_time_ns, lost_before, frame_rate_hz, red, green, blue, filter_delay_frames, error, brightest, prefixes,
     lights) = _HEADER.unpack_from(message)  # fmt: skip
    if header_bytes < _HEADER.size:
        raise ValueError(f"byte 4: a header of {header_bytes} bytes; it has {_HEADER.size} at least")
    if prefixes > MOST_PREFIX_ERRORS:
        raise ValueError(f"byte 116: {prefixes} prefix errors; {MOST_PREFIX_ERRORS} at most are read")
    if lights > MOST_LIGHTS:
        raise ValueError(f"byte 118: {lights} lights; {MOST_LIGHTS} at most are read")
    first_light = header_bytes + prefixes * _PREFIX.size
    whole = first_light + lights * _LIGHT.size
    if len(message) != whole:
        raise ValueError(
            f"byte {min(len(message), whole)}: the message has {len(message)} bytes; with {prefixes} prefix errors and "
            f"{lights} lights it has {whole}"
        )
    for byte, what, value, most in (
        (72, "the frame rate", frame_rate_hz, MOST_RATE_HZ),
        (80, "the power", red, MOST_POWER),
        (88, "the power", green, MOST_POWER),
        (96, "the power", blue, MOST_POWER),
        (108, "the error", error, MOST_ERROR),
        (112, "the highest irradiance", brightest, MOST_IRRADIANCE),
    ):
        if not 0.0 <= value <= most:
            raise ValueError(f"byte {byte}: {what} is {value}; it is from 0 to {most}")
    prefix_errors = list(_PREFIX.iter_unpack(message[header_bytes:first_light]))
    for number, (_, prefix_error) in enumerate(prefix_errors):
        if not 0.0 <= prefix_error <= MOST_ERROR:
            byte = header_bytes + number * _PREFIX.size + 4
            raise ValueError(f"byte {byte}: the error of a prefix is {prefix_error}")
    decoded = []
    ids = set()
    for number, (identity, u, v, r, g, b, spread) in enumerate(_LIGHT.iter_unpack(message[first_light:])):
        if identity in ids:
            byte = first_light + number * _LIGHT.size
            raise ValueError(f"byte {byte}: light {number} has the id {identity} of another")
        ids.add(identity)
        irradiance = (_quantity(r, brightest), _quantity(g, brightest), _quantity(b, brightest))
        decoded.append(Light(identity, _direction(u, v), irradiance, _quantity(spread, math.pi)))
    has_capture_times = flags & _HAS_CAPTURE_TIMES
    return List(
        sequence=sequence,
        capture_time_ns=capture_time_ns,
        lost_before=lost_before,
        frame_rate_hz=frame_rate_hz,
        filter_delay_frames=filter_delay_frames,
        power=(red, green, blue),
        error=error,
        prefix_errors=prefix_errors,
        lights=decoded,
        lost=lost,
        capture_monotonic_ns=capture_monotonic_ns if has_capture_times else None,
        capture_utc_ns=capture_utc_ns if has_capture_times else None,
        sent_monotonic_ns=sent_monotonic_ns,
        sent_utc_ns=sent_utc_ns,
    )


def _quantity(code: int, top: float) -> float:
    """What a code on a logarithmic scale stands for: 1024 steps an octave down from `top`, and 0."""
    return top * 2.0 ** ((code - 65535) / 1024) if code else 0.0


def _direction(u: int, v: int) -> tuple[float, float, float]:
    """Unit vector of a place on the octahedron about +Y."""
    a, b = u / 32767.5 - 1.0, v / 32767.5 - 1.0
    y = 1.0 - abs(a) - abs(b)
    if y < 0.0:
        a, b = math.copysign(1.0 - abs(b), a), math.copysign(1.0 - abs(a), b)
    # The absolute values of the three add up to 1, so that this is at least 1 / sqrt(3).
    length = math.sqrt(a * a + y * y + b * b)
    return (a / length, y / length, b / length)


# --- Messages as JSON ---------------------------------------------------------------------------------------


def decode_json(message: Union[str, bytes]) -> List:
    """Takes a JSON message apart. Raises ValueError, which names the key, where it is not sound."""
    return _list(_object(message))


def _object(message: Union[str, bytes]) -> dict:
    if len(message) > MOST_BYTES:
        raise ValueError(f"the message has more than {MOST_BYTES} bytes")
    try:
        said = json.loads(message)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"the message is no JSON: {error}") from None
    if not isinstance(said, dict):
        raise ValueError("the message is no JSON object")
    return said


def _list(said: dict) -> List:
    version = _integer(said, "version", 0, 1 << 32)
    if version != 1:
        raise ValueError(f"version: the list is of version {version}; this client reads version 1")
    stream = said.get("stream")
    if not isinstance(stream, dict):
        raise ValueError("stream: missing or no object: the message is no list on its way")
    lights = [_light(light, number) for number, light in enumerate(_array(said, "lights", MOST_LIGHTS))]
    if len({light.id for light in lights}) < len(lights):
        raise ValueError("lights: two have the same id")
    prefix_errors = []
    for pair in _array(said, "prefix_errors", MOST_LIGHTS):
        if not isinstance(pair, list) or len(pair) != 2:
            raise ValueError("prefix_errors: one is no pair of a number of lights and an error")
        keyed = dict(zip(("number", "error"), pair))
        prefix_errors.append((_integer(keyed, "number", 0, 1 << 32), _number(keyed, "error", MOST_ERROR)))
    time_ns = (-(1 << 63), 1 << 63)
    captured = [
        None if stream.get(key) is None else _integer(stream, key, *time_ns)
        for key in ("capture_monotonic_ns", "capture_utc_ns")
    ]
    return List(
        sequence=_integer(said, "sequence", 0, 1 << 64),
        capture_time_ns=_integer(said, "capture_time_ns", *time_ns),
        lost_before=_integer(said, "lost_before", 0, 1 << 64),
        frame_rate_hz=_number(said, "frame_rate_hz", MOST_RATE_HZ),
        filter_delay_frames=_integer(said, "filter_delay_frames", 0, 1 << 32),
        power=_triple(said, "power", MOST_POWER),
        error=_number(said, "error", MOST_ERROR),
        prefix_errors=prefix_errors,
        lights=lights,
        lost=_integer(stream, "lost", 0, 1 << 64),
        capture_monotonic_ns=captured[0],
        capture_utc_ns=captured[1],
        sent_monotonic_ns=_integer(stream, "sent_monotonic_ns", *time_ns),
        sent_utc_ns=_integer(stream, "sent_utc_ns", *time_ns),
    )


def _light(light: object, number: int) -> Light:
    if not isinstance(light, dict):
        raise ValueError(f"lights: number {number} is no object")
    try:
        x, y, z = _triple(light, "direction", 2.0, least=-2.0)
        if abs(math.sqrt(x * x + y * y + z * z) - 1.0) > 1e-3:
            raise ValueError("direction: no unit vector")
        irradiance = _triple(light, "irradiance", MOST_IRRADIANCE)
        # The server's pi has seven digits.
        spread_rad = _number(light, "spread_rad", math.pi + 1e-6)
        return Light(_integer(light, "id", 0, 1 << 32), (x, y, z), irradiance, spread_rad)
    except ValueError as error:
        raise ValueError(f"lights: number {number}: {error}") from None


def _integer(values: dict, key: str, least: int, end: int) -> int:
    value = values.get(key)
    if type(value) is not int or not least <= value < end:
        raise ValueError(f"{key}: missing, or no whole number from {least} to {end - 1}")
    return value


def _number(values: dict, key: str, most: float, least: float = 0.0) -> float:
    value = values.get(key)
    if type(value) not in (int, float) or not least <= value <= most:
        raise ValueError(f"{key}: missing, or no number from {least} to {most}")
    return float(value)


def _triple(values: dict, key: str, most: float, least: float = 0.0) -> tuple[float, float, float]:
    r, g, b = (_number({key: value}, key, most, least) for value in _array(values, key, 3, 3))
    return (r, g, b)


def _array(values: dict, key: str, most: int, least: int = 0) -> list:
    value = values.get(key)
    if not isinstance(value, list) or not least <= len(value) <= most:
        raise ValueError(f"{key}: missing, or no array of {least} to {most} values")
    return value


# --- The stream ---------------------------------------------------------------------------------------------


# Status codes that mean that the request may succeed later. All others from 400 to 499 refuse it for good.
_LATER = (408, 425, 429)


class Stream:
    """An iterator over the lists of a server, without end: a connection that is lost comes back.

    `url` is `ws://HOST:PORT`, the address of the server's page (`http://...`), or `HOST:PORT`; through TLS `wss://...`
    or `https://...`. Without a path it is `/ws`. `token` is sent as `Authorization: Bearer ...`. Lists come as bytes
    unless `binary` is false. The rest says which lists are wanted:

    - `lights`: so many lights at most; the later ones join them, power is kept.
    - `error`: as few lights as have an error under this.
    - `rate_hz`: so many lists a second at most.
    - `queue`: lists that wait at the server for a slow client, 1 (the default) to 64. Behind that come the newest:
      leave it for showing lights, raise it for recording them.

    `next` raises `Refused` when the server says no for good, and ValueError for a message that is not sound, after
    which it may be called again. `subscribe` and `close` may be called from other threads.
    """

    FIRST_WAIT_S = 0.25
    """Before the second attempt to connect; doubles from attempt to attempt until a list has arrived."""
    LONGEST_WAIT_S = 10.0
    """The longest wait between two attempts."""

    def __init__(
        self,
        url: str,
        token: Optional[str] = None,
        binary: bool = True,
        lights: Optional[int] = None,
        error: Optional[float] = None,
        rate_hz: Optional[float] = None,
        queue: Optional[int] = None,
    ):
        self._url = _address(url)
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._subprotocol = BINARY if binary else JSON
        # The subscription that is wanted, and the one that the server has accepted: the two differ until it
        # answers.
        self._wanted = self._agreed = _subscription(lights, error, rate_hz, queue)
        self._attempts = 0
        self._closed = threading.Event()
        self._connections = contextlib.ExitStack()
        self._connection = None

    def __iter__(self) -> "Stream":
        return self

    def __next__(self) -> List:
        while not self._closed.is_set():
            try:
                if self._connection is None:
                    self._connect()
                    if self._closed.is_set():
                        break  # `close` found no connection yet
                message = self._connection.recv()
                if self._closed.is_set():
                    break  # a list that had come before `close`
            except (ssl.SSLCertVerificationError, InvalidURI):
                raise
            except (OSError, WebSocketException) as fault:
                self._disconnect()
                if not self._closed.is_set():
                    wait_s = self._next_wait_s()
                    LOG.warning("%s: %s; next attempt in %.1f s", self._url.netloc, fault or "no answer", wait_s)
                    self._closed.wait(wait_s)
                continue
            lights = self._take(message)
            if lights is not None:
                self._attempts = 0
                return lights
        self._disconnect()
        raise StopIteration

    def __enter__(self) -> "Stream":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def subscribe(
        self,
        lights: Optional[int] = None,
        error: Optional[float] = None,
        rate_hz: Optional[float] = None,
        queue: Optional[int] = None,
    ) -> None:
        """Says anew which lists are wanted, all of it: what is left out has its default.

        Where the server does not take it, the next `next` raises `Refused` and all stays as it was.
        """
        self._wanted = _subscription(lights, error, rate_hz, queue)
        connection = self._connection
        if connection is not None:
            # If the connection is lost meanwhile, the next one begins with the wanted subscription.
            with contextlib.suppress(OSError, WebSocketException):
                connection.send(json.dumps({"subscribe": self._wanted}))

    def close(self) -> None:
        """Ends the iteration."""
        self._closed.set()
        connection = self._connection
        if connection is not None:
            connection.close()

    def _connect(self) -> None:
        asked = self._wanted
        query = "&".join(filter(None, (self._url.query, urllib.parse.urlencode(asked))))
        try:
            # The shortest queue at this end: lists that are not yet read wait at the server, which sends the
            # newest.
            opening = connect(
                self._url._replace(query=query).geturl(),
                subprotocols=[self._subprotocol],
                # 16-bit codes hardly compress.
                compression=None,
                additional_headers=self._headers,
                max_size=MOST_BYTES,
                max_queue=1,
                # Lists that are no longer read delay the server's answer to the closing handshake.
                close_timeout=0.5,
            )
            self._connection = self._connections.enter_context(opening)
        except InvalidStatus as fault:
            status, why = fault.response.status_code, _reason(fault.response)
            answer = f"the server answers with status {status}: {why}"
            if not 400 <= status < 500 or status in _LATER:
                raise ConnectionError(answer) from None
            raise Refused(answer) from None
        except NegotiationError as fault:
            raise Refused(f"the server does not speak {self._subprotocol}: {fault}") from None
        if self._connection.subprotocol is None:
            self._disconnect()
            raise Refused(f"the server does not speak {self._subprotocol}")
        self._agreed = asked
        if self._wanted is not asked:
            self._connection.send(json.dumps({"subscribe": self._wanted}))

    def _disconnect(self) -> None:
        self._connection = None
        with contextlib.suppress(OSError, WebSocketException):
            self._connections.close()

    def _next_wait_s(self) -> float:
        longest_s = min(self.LONGEST_WAIT_S, self.FIRST_WAIT_S * 2.0 ** min(self._attempts, 64))
        self._attempts += 1
        # The clients of a restarted server should not all reconnect at the same time.
        return longest_s * random.uniform(0.5, 1.0)

    def _take(self, message: Union[str, bytes]) -> Optional[List]:
        """The list in a message; None where it is an answer."""
        if isinstance(message, bytes):
            return decode_binary(message)
        said = _object(message)
        if "lights" in said:
            return _list(said)
        if "error" in said:
            self._wanted = self._agreed
            raise Refused(f"the server does not take the subscription: {said['error']}")
        if "subscribed" in said:
            self._agreed = self._wanted
        return None


_ADDRESS = re.compile(r"(?:(ws|http)(s?)://)?([^\s/?#\\]+)(/[^\s?#]*)?(\?[^\s#]*)?(?:#\S*)?", re.IGNORECASE)


def _address(url: str) -> urllib.parse.SplitResult:
    """The address of the stream that `url` names."""
    refused = ValueError(f"{url!r} is no address of a server, such as ws://127.0.0.1:7300")
    match = _ADDRESS.fullmatch(url)
    if match is None:
        raise refused
    scheme, secure, authority, path, query = (group or "" for group in match.groups())
    # Fragments are for pages.
    split = urllib.parse.SplitResult(f"ws{secure.lower()}", authority, "/ws" if path in ("", "/") else path, query[1:], "")
    try:
        is_server = split.hostname and split.port != 0 and (scheme or split.port)
    except ValueError:
        is_server = False
    if not is_server:
        raise refused
    return split


def _reason(response: Response) -> str:
    """What a server says to its refusal: the first line of it, made safe for a terminal."""
    line = next(iter((response.body or b"").decode(errors="replace").strip().splitlines()), "")
    return "".join(filter(str.isprintable, line))[:200] or response.reason_phrase


def _subscription(
    lights: Optional[int], error: Optional[float], rate_hz: Optional[float], queue: Optional[int]
) -> dict:
    for key, value, most in (("lights", lights, MOST_LIGHTS), ("queue", queue, MOST_QUEUED)):
        if value is not None and (type(value) is not int or not 1 <= value <= most):
            raise ValueError(f"{key}: give a whole number from 1 to {most}")
    for key, value in (("error", error), ("rate_hz", rate_hz)):
        if value is not None and not 0.0 < value < math.inf:
            raise ValueError(f"{key}: give a number above 0")
    keys = {"lights": lights, "error": error, "rate_hz": rate_hz, "queue": queue}
    return {key: value for key, value in keys.items() if value is not None}
