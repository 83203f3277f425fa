"""The decoders against the golden message, sound and damaged."""

import contextlib
import json
import math
import random
import struct
import time
import unittest

from golden import BIN, ROOT, TEXT

import lightcast


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

    def test_suns_stand_where_blender_and_three_show_them_in_the_panorama(self):
        # Where Blender's and three.js's environment textures look for a direction: u from the left, v from below.
        mappings = {
            "blender": lambda x, y, z: (0.5 - math.atan2(y, x) / math.tau, 0.5 + math.atan2(z, math.hypot(x, y)) / math.pi),
            "three": lambda x, y, z: (0.5 + math.atan2(z, x) / math.tau, 0.5 + math.asin(y) / math.pi),
        }
        for sun in json.loads((ROOT / "tests/clients/suns.json").read_text()):
            light = lightcast.Light(0, tuple(sun["direction"]), (1.0, 1.0, 1.0), 0.0)
            self.assertEqual(light.direction_in("world"), light.direction)
            for axes, mapping in mappings.items():
                u, v = mapping(*light.direction_in(axes))
                self.assertAlmostEqual(u, sun["u"], delta=1e-12, msg=f"{axes} {sun}")
                self.assertAlmostEqual(v, sun["v"], delta=1e-12, msg=f"{axes} {sun}")
        with self.assertRaises(ValueError) as caught:
            light.direction_in("unity")
        self.assertEqual(str(caught.exception), "axes: 'unity' is not known; give one of world, blender, three")

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
