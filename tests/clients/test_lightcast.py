"""Tests of clients/lightcast.py: its decoders against the golden message, its stream against a server in this process.

    python tests/clients/test_lightcast.py
    python tests/clients/test_lightcast.py --url ws://127.0.0.1:7300/ws --count 10 [--token T] [--json] [--lights 8 ...]

With --url it connects to a running server instead and prints a line of JSON for each of --count lists.
"""

import argparse
import faulthandler
import json
import sys
import unittest

import golden  # noqa: F401, says where lightcast is
import lightcast
from decoders import Decoders  # noqa: F401
from streams import Streams  # noqa: F401


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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
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
