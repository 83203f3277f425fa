"""Prints what comes from a lightcast server: python example.py 127.0.0.1:7300 [TOKEN]"""

import os
import sys

import lightcast


def main() -> None:
    for lights in lightcast.Stream(*sys.argv[1:3], lights=64, rate_hz=5):
        power = ", ".join(f"{value:.4g}" for value in lights.power)
        print(f"list {lights.sequence}: {len(lights.lights)} lights, power {power}, error {lights.error:.4f}")
        if lights.lights:
            print("  brightest:", max(lights.lights, key=lambda light: sum(light.irradiance)))
        sys.stdout.flush()


try:
    main()
except KeyboardInterrupt:
    pass
except BrokenPipeError:
    # Nobody reads any more, as under `| head`; Python would try to write the rest at its end.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
