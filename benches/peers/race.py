"""Ours and its peers in turns, and the table of what came out."""

import json
import subprocess
import time

import numpy as np

# A burst lasts at least this long; bursts of both sides alternate, and medians are over the steps of all
# bursts. Times are the thread's processor time: time that other processes take meanwhile does not count.
BURST_S, ROUNDS = 0.03, 9


class Lightcast:
    """The Rust program of this benchmark; main.rs says what it understands."""

    def __init__(self, command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, **request):
        self.process.stdin.write(json.dumps(request, default=str) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit(f"lightcast's side ended at {request}; its message is above")
        return json.loads(answer)

    def repeat(self, count):
        return self.ask(repeat=count)["seconds"]

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def timed(step):
    """`repeat` of a step in Python."""

    def repeat(count):
        seconds = []
        for _ in range(count):
            start = time.thread_time()
            step()
            seconds.append(time.thread_time() - start)
        return seconds

    return repeat


def race(*sides):
    """Median times in ms of functions that repeat a step so many times and give the seconds of each."""
    bursts = [max(1, round(BURST_S / min(side(3)))) for side in sides]
    seconds = [[] for _ in sides]
    for _ in range(ROUNDS):
        for side, burst, all_seconds in zip(sides, bursts, seconds):
            all_seconds += side(burst)
    return [1e3 * float(np.median(all_seconds)) for all_seconds in seconds]


class Table:
    """Lines as they stand in docs/results.md."""

    def section(self, title, remark=""):
        print(f"\n{title:<66}{'ours ms':>10}{'peer ms':>10}{'ratio':>7}   {remark}".rstrip(), flush=True)

    def row(self, name, peer, ours_ms, peer_ms, remark=""):
        ratio = f"{peer_ms / ours_ms:7.2f}"
        print(f"  {name:<26}{peer:<38}{ours_ms:10.4f}{peer_ms:10.4f}{ratio}   {remark}".rstrip(), flush=True)
