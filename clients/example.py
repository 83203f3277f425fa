"""Prints what comes from a lightcast server: python example.py ws://127.0.0.1:7300/ws [TOKEN]"""

import sys

import lightcast

for lights in lightcast.Stream(*sys.argv[1:3], lights=64, rate_hz=5):
    power = ", ".join(f"{value:.4g}" for value in lights.power)
    print(f"list {lights.sequence}: {len(lights.lights)} lights, power {power}, error {lights.error:.4f}")
    if lights.lights:
        print("  brightest:", max(lights.lights, key=lambda light: sum(light.irradiance)))
