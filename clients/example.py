"""Prints what comes from a lightcast server: python example.py ws://127.0.0.1:8080/ws [TOKEN]"""

import sys

import lightcast

for lights in lightcast.Stream(*sys.argv[1:3], lights=64, rate_hz=5):
    brightest = max(lights.lights, key=lambda light: sum(light.irradiance), default=None)
    print(f"list {lights.sequence}: {len(lights.lights)} lights, power {lights.power}, error {lights.error:.4f}")
    print(f"  age {lights.age_s()} s, lost {lights.lost}, brightest: {brightest}")
