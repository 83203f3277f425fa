"""Prints the figures in src/picture/flip/tests.rs: FLIP by the reference implementation on the same pictures.

    pip install numpy flip-evaluator==1.7
    python tests/flip/reference.py
"""

import flip_evaluator
import numpy as np

WIDTH, HEIGHT = 96, 64


def noise(seed):
    """The 8-bit values of `noise` in tests.rs for every pixel and channel."""
    y, x, channel = np.indices((HEIGHT, WIDTH, 3), dtype=np.uint32)
    with np.errstate(over="ignore"):
        value = (x + np.uint32(4096) * y + np.uint32(16777216) * channel) ^ np.uint32(seed)
        for factor in (0x9E3779B1, 0x85EBCA77):
            value = value * np.uint32(factor)
            value ^= value >> np.uint32(15)
    return (value >> np.uint32(8)) & np.uint32(255)


def picture(colour):
    y, x, channel = np.indices((HEIGHT, WIDTH, 3), dtype=np.int64)
    return np.broadcast_to(colour(x, y, channel), (HEIGHT, WIDTH, 3)).astype(np.uint8)


def gradient(x, y, channel):
    return np.choose(channel, [x * 255 // 95, y * 255 // 63, 255 - x * 255 // 95])


CASES = {
    "black and white": (lambda x, y, c: 0, lambda x, y, c: 255),
    "green and blue": (lambda x, y, c: 255 * (c == 1), lambda x, y, c: 255 * (c == 2)),
    "two noises": (lambda x, y, c: noise(1), lambda x, y, c: noise(2)),
    "gradient, coarser": (gradient, lambda x, y, c: gradient(x, y, c) // 16 * 16),
    "gradient, with noise": (gradient, lambda x, y, c: (gradient(x, y, c) * 3 + noise(3)) // 4),
    "edges, shifted by a pixel": (
        lambda x, y, c: 40 + 180 * ((x // 11 + y // 9) % 2),
        lambda x, y, c: 40 + 180 * (((x + 1) // 11 + y // 9) % 2),
    ),
    "dots, left out": (
        lambda x, y, c: np.where((x % 13 == 5) & (y % 17 == 8), 250, 90),
        lambda x, y, c: 90,
    ),
    "coloured discs, another colour": (
        lambda x, y, c: np.where((x - 48) ** 2 + (y - 30) ** 2 < 400, np.choose(c, [200, 30, 60]), 128),
        lambda x, y, c: np.where((x - 48) ** 2 + (y - 30) ** 2 < 400, np.choose(c, [180, 60, 40]), 128),
    ),
}

for name, pair in CASES.items():
    reference, test = [picture(colour).astype(np.float32) / 255 for colour in pair]
    for pixels_per_degree in (3840 * np.pi / 180, 20.0):
        parameters = {"ppd": float(pixels_per_degree)}
        error, _, _ = flip_evaluator.evaluate(reference, test, "LDR", True, False, False, parameters)
        # The mean that the package itself returns is summed in float32.
        error = error[..., 0].astype(np.float64)
        print(f'("{name}", {pixels_per_degree:.4f}): mean {error.mean():.7f}, at (30, 20) {error[20, 30]:.7f}')
