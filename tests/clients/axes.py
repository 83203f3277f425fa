"""Directions for other programs, by where these show a panorama's sun; addresses as they are typed."""

import math
import unittest

import lightcast

# Columns and rows of suns in a lat-long panorama, from its upper left corner, as fractions of its size.
SUNS = [(0.5, 0.5), (0.31, 0.22), (0.87, 0.4), (0.06, 0.71)]


def light(u, v):
    """A light at a place of a panorama, in our axes: the middle is +Z, left of it +X, the top row +Y."""
    theta, phi = math.pi * v, 2 * math.pi * u - math.pi / 2
    direction = (math.sin(theta) * math.cos(phi), math.cos(theta), math.sin(theta) * math.sin(phi))
    return lightcast.Light(0, direction, (1.0, 1.0, 1.0), 0.0)


def place_in_blender(direction):
    """Where Cycles' equirectangular mapping looks a direction up: columns from the left, rows from the bottom."""
    x, y, z = direction
    return -math.atan2(y, x) / (2 * math.pi) + 0.5, math.atan2(z, math.hypot(x, y)) / math.pi + 0.5


def place_in_three(direction):
    """The same for three.js' function equirectUv."""
    x, y, z = direction
    return math.atan2(z, x) / (2 * math.pi) + 0.5, math.asin(y) / math.pi + 0.5


class Axes(unittest.TestCase):
    def test_a_sun_stands_where_the_program_shows_it(self):
        for program, place in (("blender", place_in_blender), ("three", place_in_three)):
            for u, v in SUNS:
                column, row = place(light(u, v).direction_in(program))
                self.assertAlmostEqual(column, u, places=12, msg=program)
                self.assertAlmostEqual(row, 1 - v, places=12, msg=program)

    def test_our_own_axes_and_unknown_ones(self):
        sun = light(*SUNS[1])
        self.assertEqual(sun.direction_in("world"), sun.direction)
        with self.assertRaisesRegex(ValueError, "maya: unknown axes; there are blender, three, world"):
            sun.direction_in("maya")

    def test_addresses_are_those_that_watch_takes(self):
        for typed, whole in (
            ("studio:7300", "ws://studio:7300/ws"),
            ("studio", "ws://studio/ws"),
            ("ws://studio:7300", "ws://studio:7300/ws"),
            ("http://studio:7300/", "ws://studio:7300/ws"),
            ("https://studio.example", "wss://studio.example/ws"),
            ("[::1]:7300", "ws://[::1]:7300/ws"),
            ("wss://studio.example/light/ws", "wss://studio.example/light/ws"),
        ):
            self.assertEqual(lightcast._address(typed).geturl(), whole)
        for wrong in ("", ":7300", "ftp://studio", "studio:http", "studio:0", "ws://"):
            with self.assertRaisesRegex(ValueError, "is no address of a server"):
                lightcast._address(wrong)
