#!/usr/bin/env python3
"""Attacks a service on this machine and prints what it does meanwhile.

    tests/attack/attack.py target/release/lightcast

Every attack has at most 1,500 connections and lasts four seconds. It fails where a health check takes more than
a second, where lists come slower than nine tenths of what they do unattacked, or where the service does not
end when it is asked to.
"""

import base64
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

SECONDS = 4.0
CONFIGURATION = """[source]
kind = "sequence"
path = "{replay}/"
frame_rate_hz = 25.0
repeat = true

[camera]
projection = "fisheye"
calibration = "{replay}/calibration.json"

[map]
columns = 256
rows = 64
"""


def connect(port):
    return socket.create_connection(("127.0.0.1", port), timeout=5)


def stream(port, queue=64):
    """A client of lists, connected."""
    client = connect(port)
    key = base64.b64encode(os.urandom(16)).decode()
    client.sendall(
        f"GET /ws?queue={queue} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
        "Sec-WebSocket-Protocol: lightcast.v1.bin\r\n\r\n".encode()
    )
    client.recv(1024)
    return client


def idle(port, until):
    held = [connect(port) for _ in range(1500)]
    time.sleep(max(0.0, until - time.monotonic()))
    return held


def slow_maps(port, until):
    held = []
    for _ in range(70):
        client = connect(port)
        client.sendall(f"GET /map.exr HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        held.append(client)
    time.sleep(max(0.0, until - time.monotonic()))
    return held


def flood(port, until, frames):
    """Sends frames for as long as the server takes them, and comes again."""
    while time.monotonic() < until:
        client = stream(port)
        try:
            while time.monotonic() < until:
                client.sendall(frames)
        except OSError:
            client.close()
            time.sleep(0.01)


def empty_parts(port, until):
    flood(port, until, b"\x01\x80mask" + b"\x00\x80mask" * 1000)


def pings(port, until):
    flood(port, until, b"\x89\x80mask" * 1000)


def strangers(port, until):
    """Pages of others, each of an origin of its own."""
    for number in range(2000):
        if time.monotonic() >= until:
            return
        with connect(port) as client:
            head = f"GET /lights HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: https://{number}.example\r\n\r\n"
            client.sendall(head.encode())
            client.recv(100)


def come_and_go(port, until):
    for _ in range(2000):
        if time.monotonic() >= until:
            return
        stream(port).close()


def nothing(_port, until):
    time.sleep(max(0.0, until - time.monotonic()))


ATTACKS = [
    ("1500 idle connections", idle),
    ("70 maps that nobody takes", slow_maps),
    ("empty parts of a message", empty_parts),
    ("pings", pings),
    ("pages of 2000 others", strangers),
    ("clients that come and go", come_and_go),
]


def figure(port, name):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
        for line in answer.read().decode().splitlines():
            if line.startswith(name):
                return float(line.rsplit(" ", 1)[1])
    return 0.0


def process_seconds(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_mb(pid):
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        line = next(line for line in file if line.startswith("VmRSS:"))
    return int(line.split()[1]) / 1024


def attack(service, port, name, act, rate_needed_hz):
    """Runs one attack; returns lists a second, and whether the service bore it."""
    frames = 'lightcast_stage_frames_total{stage="board"}'
    before, spent, held = figure(port, frames), process_seconds(service.pid), []
    until = time.monotonic() + SECONDS
    thread = threading.Thread(target=lambda: held.append(act(port, until)), name=name, daemon=True)
    started = time.monotonic()
    thread.start()
    slowest_s = 0.0
    while time.monotonic() < until:
        asked = time.monotonic()
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=5) as answer:
                answer.read()
        except OSError:
            slowest_s = 5.0
        slowest_s = max(slowest_s, time.monotonic() - asked)
        time.sleep(0.1)
    thread.join(5)
    elapsed = time.monotonic() - started
    held.clear()
    rate_hz = (figure(port, frames) - before) / elapsed
    cores = (process_seconds(service.pid) - spent) / elapsed
    is_good = slowest_s < 1.0 and rate_hz >= rate_needed_hz
    print(
        f"{name:28} {slowest_s * 1e3:9.1f} {rate_hz:9.2f} {cores:7.2f} {resident_mb(service.pid):8.1f}"
        f"  {'ok' if is_good else 'BAD'}",
        flush=True,
    )
    return rate_hz, is_good


def main():
    program = os.path.abspath(sys.argv[1])
    replay = os.path.join(os.path.dirname(__file__), "..", "..", "replay", "day")
    resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
    with tempfile.TemporaryDirectory() as folder:
        configuration = os.path.join(folder, "attack.toml")
        with open(configuration, "w", encoding="utf-8") as file:
            file.write(CONFIGURATION.format(replay=os.path.abspath(replay)))
        # Nobody reads its messages after the first.
        service = subprocess.Popen(
            [program, "run", configuration, "--listen", "127.0.0.1:0"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env={**os.environ, "RUST_LOG": "debug"},
        )
        line = b""
        while b"listening on http://" not in line:
            line = service.stderr.readline()
        port = int(line.split(b"http://127.0.0.1:")[1].split(b"/")[0])
        time.sleep(2)
        print(f"{'attack':28} {'health ms':>9} {'lists/s':>9} {'cores':>7} {'MB':>8}")
        alone_hz, is_good = attack(service, port, "nothing", nothing, 0.0)
        for name, act in ATTACKS:
            is_good &= attack(service, port, name, act, 0.9 * alone_hz)[1]
        dropped = figure(port, 'lightcast_stage_drops_total{stage="messages"}')
        service.send_signal(signal.SIGTERM)
        asked = time.monotonic()
        code = service.wait(30)
        ended_s = time.monotonic() - asked
        print(f"{dropped:.0f} messages dropped that nobody read; ended with {code} after {ended_s:.1f} s")
        sys.exit(0 if is_good and code == 0 and ended_s < 10 else 1)


main()
