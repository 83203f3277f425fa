"""What `compare.py --self-test` does: orientation of map and camera, and radiometry, against closed forms; without
lightcast."""

import argparse

import mitsuba as mi
import numpy as np
from compare import COLUMNS, GROUND_ALBEDO, MESH_ALBEDO, ROWS
from compare import averaged, envmap, first_hits, ground, lambert, neighbourhood, render


def direction(theta, phi):
    """World direction of a polar angle and an azimuth, +Y up."""
    return np.array([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)])


def middle(row, column):
    """Direction of the middle of a pixel of the averaged map."""
    return direction(np.pi * (row + 0.5) / ROWS, 2 * np.pi * (column + 0.5) / COLUMNS - np.pi / 2)


def self_test():
    rng = np.random.default_rng(1)
    # The map, looked up in any direction.
    pixels = rng.uniform(size=(ROWS, COLUMNS, 3))
    light = mi.load_dict({"type": "scene", "light": envmap(pixels)}).environment()
    worst = 0
    for row, column in zip(rng.integers(0, ROWS, 400), rng.integers(0, COLUMNS, 400)):
        towards = middle(row, column)
        hit = mi.SurfaceInteraction3f()
        hit.wi = mi.Vector3f(*(-towards))
        worst = max(worst, np.abs(np.array(light.eval(hit)) - pixels[row, column]).max())
    print(f"map: largest difference in the middle of 400 pixels {worst:.1e}")
    assert worst < 1e-4

    # Averaging keeps the power, and a constant.
    fine = rng.uniform(size=(512, 1024, 3))
    zones = lambda count: -np.diff(np.cos(np.linspace(0, np.pi, count + 1))) * 2 * np.pi
    power = lambda image: np.einsum("i,ijc->c", zones(len(image)), image) / image.shape[1]
    assert np.allclose(power(averaged(fine)), power(fine)) and np.allclose(averaged(fine * 0 + 3), 3)

    # A sphere and a plane under a map with one bright pixel: radiance = albedo / pi * E * max(0, n . l), and
    # the camera: a point is seen where the pinhole says.
    arguments = argparse.Namespace(size=(64, 48), eye=[1.5, 2.0, 3.0], target=[0.3, 0.4, -0.2], fov=50.0)
    shapes = {
        "mesh": {"type": "sphere", "center": [0, 1, 0], "radius": 0.8, "bsdf": lambert(MESH_ALBEDO)},
        "plane": ground(np.array([-0.8, -0.6, -0.8]), np.array([0.8, 1.0, 0.8])),
    }
    cover, position, normal, on_mesh = first_hits(shapes, arguments)
    whole = (cover > 0.999) & (neighbourhood(on_mesh, np.max) == neighbourhood(on_mesh, np.min))

    forward = np.array(arguments.target) - arguments.eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    offset = position - arguments.eye
    scale = 24 / np.tan(np.radians(arguments.fov / 2)) / (offset @ forward)
    at = np.stack([32 + offset @ right * scale, 24 - offset @ np.cross(right, forward) * scale], -1)
    y, x = np.indices(whole.shape) + 0.5
    away = np.linalg.norm(at - np.stack([x, y], -1), axis=-1)[whole & on_mesh].max()
    print(f"camera: points on the sphere are seen at most {away:.2f} px from where the pinhole says")
    assert away < 0.3

    for row, column in [(20, 10), (50, 100), (70, 200), (40, 300)]:
        pixels = np.zeros((ROWS, COLUMNS, 3))
        pixels[row, column] = [1e4, 2e4, 3e4]
        towards = middle(row, column)
        irradiance = pixels[row, column] * zones(ROWS)[row] / COLUMNS
        found = render(shapes, arguments, pixels, 1024, 0)
        albedo = np.where(on_mesh, MESH_ALBEDO, GROUND_ALBEDO)
        wanted = (albedo / np.pi * np.maximum(normal @ towards, 0))[..., None] * irradiance
        # Away from the terminator, and on the ground in or out of the sphere's shadow: how far the line
        # towards the light passes from its centre, give or take the width of the map's pixel and of the
        # picture's.
        centre = np.array([0, 1, 0]) - position
        along = centre @ towards
        passes = np.linalg.norm(centre - along[..., None] * towards, axis=-1)
        width = 0.02 * np.abs(along) + 0.15
        clear = whole & np.where(on_mesh, normal @ towards > 0.1, (passes > 0.8 + width) | (along < 0))
        shadowed = whole & ~on_mesh & (passes < 0.8 - width) & (along > 0)
        ratio = found[clear] / wanted[clear]
        print(f"row {row}, column {column}: mean of rendered by closed form {ratio.mean():.4f}, ", end="")
        print(f"largest difference {np.abs(ratio - 1).max():.1e}; {shadowed.sum()} pixels in shadow")
        assert abs(ratio.mean() - 1) < 1e-3 and np.abs(ratio - 1).max() < 0.02
        assert shadowed.sum() > 5 and found[shadowed].max() == 0
    print("ok")
    return 0
