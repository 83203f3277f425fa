"""Prints what comes from a lightcast server: python example.py [127.0.0.1:7300 [TOKEN]]"""

import os
import sys

import lightcast


def main() -> None:
    with lightcast.Stream(*(sys.argv[1:3] or ["127.0.0.1:7300"]), lights=64, rate_hz=5) as stream:
        for lights in stream:
            power = ", ".join(f"{value:.4g}" for value in lights.power)
            print(f"list {lights.sequence}: {len(lights.lights)} lights, power {power}, error {lights.error:.4f}")
            if lights.lights:
                print("  brightest:", max(lights.lights, key=lambda light: sum(light.irradiance)))
            # Also into a pipe while the list is new.
            sys.stdout.flush()


try:
    main()
except KeyboardInterrupt:
    pass
except BrokenPipeError:
    # Whoever reads has seen enough (`| head`). What is left goes nowhere: Python writes it at its end.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
except (ValueError, lightcast.Refused) as fault:
    sys.exit(str(fault))
