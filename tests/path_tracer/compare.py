"""Compares the renderer with an independent path tracer: same mesh, map and camera, direct light only.

    python -m venv venv && venv/bin/pip install numpy mitsuba==3.9.1
    venv/bin/python tests/path_tracer/compare.py --self-test
    venv/bin/python tests/path_tracer/compare.py --lightcast target/release/lightcast --map MAP.hdr --mesh MESH.obj

Exit code 0: mean relative error at most 2 % outside of shadow edges; 1: more; 2: nothing to compare.

What is compared
- The mesh is read here, gets angle-weighted smooth normals and is written as mesh.ply, which both programs load: so
  neither's own normals come in. A ground (albedo 0.5, eight times as wide as the mesh and four times as it is high, at
  its lowest point) is added by both: by lightcast itself, here as a rectangle. All is Lambert; the mesh has albedo 0.6,
  what lightcast gives a PLY file without colours.
- The map is the upper hemisphere of the .hdr file, averaged over exact solid angles to 360 x 90 pixels, as lightcast
  does; below the horizon it is black. Both renderers get the same averaged map, so resolution is no difference; that
  one has lights in the middle of its pixels and the other has pixels that are a degree wide is, at shadow edges.
- Mitsuba's `direct` integrator samples the map only; box filter. The map's brightest pixels, over 30 times the mean,
  and the rest are rendered apart and added: shadows of the sun would be noisy if most samples went to the sun.

What is left out (the mask)
- Pixels that show the backdrop in mitsuba's picture, in whole or in part.
- Silhouettes: pixels where, among their 8 neighbours, another shape or the backdrop is seen, distance changes by more
  than 5 % or normals differ by more than 30 degrees.
- Shadow edges: pixels where, among their 8 neighbours, irradiance (radiance by albedo) in mitsuba's picture changes
  by more than --edge (15 %) of the largest, plus six times the noise there.
- The neighbours of all of these, --margin pixels (2) wide.

The error of a pixel is the mean over R, G, B of |lightcast - mitsuba|, relative to mitsuba's mean over R, G, B there or
to 5 % of its mean over the kept pixels, whichever is larger. Mitsuba's noise, which is part of the error, is estimated
from two halves of the samples and printed beside it.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

LIMIT = 0.02
MESH_ALBEDO, GROUND_ALBEDO = 0.6, 0.5
COLUMNS, ROWS = 360, 180
# Pixels of mitsuba's map along a side of one of ours: it interpolates, which is to reach only a fraction of ours.
FINER = 4


def lightcast_command(arguments, mesh, picture):
    """The one place that knows lightcast's command line."""
    vector = lambda values: ",".join(f"{value:.9g}" for value in values)
    # With `=`, so that a negative number is no option.
    view = [f"--eye={vector(arguments.eye)}", f"--target={vector(arguments.target)}", f"--fov={arguments.fov:.9g}"]
    scene = ["--scene", mesh, "--ground", "--size", "{}x{}".format(*arguments.size), *view, "--output", picture]
    return [arguments.lightcast, "render", arguments.map, "--hemisphere", "--reference", *scene]


# --- The map ------------------------------------------------------------------------------------------------


def overlaps(coarse, fine):
    """Parts of the coarse intervals that each fine one takes; edges in rising order."""
    inside = np.minimum(coarse[1:, None], fine[None, 1:]) - np.maximum(coarse[:-1, None], fine[None, :-1])
    return np.maximum(inside, 0) / np.diff(coarse)[:, None]


def averaged(latlong):
    """A lat-long picture averaged over solid angles to COLUMNS x ROWS, in the file's own orientation."""
    height, width = latlong.shape[:2]
    edges = lambda count: -np.cos(np.linspace(0, np.pi, count + 1))
    down = overlaps(edges(ROWS), edges(height))
    across = overlaps(np.linspace(0, 1, COLUMNS + 1), np.linspace(0, 1, width + 1))
    return np.einsum("ij,jkc,lk->ilc", down, latlong, across, optimize=True)


def envmap(latlong):
    """Mitsuba's emitter for a lat-long picture of constant pixels in OpenEXR's orientation: column u in [0, 1) is
    phi = 2 pi u - pi/2, row v is theta = pi v. Mitsuba's own is the same, so `to_world` stays the identity, except
    that its first and last row lie on the poles: there is one row more, and those between two of our rows are their
    mean. --self-test proves it."""
    rows = np.repeat(latlong, FINER, axis=0)
    rows = np.concatenate([rows[:1], (rows[1:] + rows[:-1]) / 2, rows[-1:]])
    return {"type": "envmap", "bitmap": mi.Bitmap(np.repeat(rows, FINER, axis=1).astype(np.float32))}


# --- The mesh -----------------------------------------------------------------------------------------------


def read_obj(path):
    """Positions and triangles; everything else in the file is left out."""
    positions, triangles = [], []
    for line in Path(path).read_text().splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            positions.append([float(value) for value in rest[:3]])
        elif word == "f":
            corners = [int(corner.split("/")[0]) for corner in rest]
            corners = [corner - 1 if corner > 0 else len(positions) + corner for corner in corners]
            triangles += [[corners[0], a, b] for a, b in zip(corners[1:], corners[2:])]
    return np.array(positions), np.array(triangles)


def smooth_normals(positions, triangles):
    """Normals of the triangles around each vertex, weighted by their angle there; +Y where there are none."""
    unit = lambda v: v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
    corners = positions[triangles]
    face = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    normals = np.zeros_like(positions)
    for i in range(3):
        sides = [unit(corners[:, (i + k) % 3] - corners[:, i]) for k in (1, 2)]
        angle = np.arccos(np.clip(np.sum(sides[0] * sides[1], -1), -1, 1))
        np.add.at(normals, triangles[:, i], face * angle[:, None])
    return np.where(np.linalg.norm(normals, axis=1, keepdims=True) > 0, unit(normals), [0, 1, 0])


def write_ply(path, positions, normals, triangles):
    names = "x y z nx ny nz".split()
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(positions)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header\n"]
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    vertices = np.hstack([positions, normals]).astype("<f4")
    Path(path).write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())


def ground(low, high):
    """The ground under a box."""
    size = high - low
    half = 4 * float(max(size[0], size[2], 0.5 * size[1]))
    place = mi.ScalarTransform4f().translate([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    upright = place.rotate([1, 0, 0], -90).scale(half)
    return {"type": "rectangle", "to_world": upright, "bsdf": lambert(GROUND_ALBEDO)}


# --- Rendering ----------------------------------------------------------------------------------------------


def lambert(albedo):
    diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [albedo] * 3}}
    return {"type": "twosided", "bsdf": diffuse}


def camera(arguments, sampler):
    width, height = arguments.size
    look_at = mi.ScalarTransform4f().look_at(origin=arguments.eye, target=arguments.target, up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgba"}
    lens = {"type": "perspective", "fov": arguments.fov, "fov_axis": "y", "near_clip": 1e-3, "far_clip": 1e5}
    return {**lens, "to_world": look_at, "film": film, "sampler": sampler}


def render(shapes, arguments, latlong, paths, seed):
    """Radiance of direct light; `paths` samples of the map's brightest pixels for every pixel, and of the rest."""
    luminance = latlong @ [0.2126, 0.7152, 0.0722]
    is_bright = (luminance > 30 * luminance.mean())[..., None]
    parts = [latlong * is_bright, latlong * ~is_bright]
    return sum(render_part(shapes, arguments, part, paths, seed) for part in parts if part.any())


def render_part(shapes, arguments, latlong, paths, seed):
    per_pixel = min(paths, 16)
    samples = {"emitter_samples": -(-paths // per_pixel), "bsdf_samples": 0}
    integrator = {"type": "direct", "hide_emitters": True, **samples}
    sensor = camera(arguments, {"type": "multijitter", "sample_count": per_pixel})
    scene = {"type": "scene", "sensor": sensor, "light": envmap(latlong), "integrator": integrator, **shapes}
    return np.array(mi.render(mi.load_dict(scene), seed=seed), dtype=np.float64)[..., :3]


def first_hits(shapes, arguments):
    """What pixels show, as means over their area: share that is no backdrop, position, normal, is it the mesh."""
    integrator = {"type": "aov", "aovs": "position:position,normal:sh_normal,shape:shape_index"}
    integrator["image"] = {"type": "direct", "hide_emitters": True}
    sensor = camera(arguments, {"type": "multijitter", "sample_count": 64})
    scene = {"type": "scene", "sensor": sensor, "integrator": integrator, "light": {"type": "constant"}, **shapes}
    scene = mi.load_dict(scene)
    found = np.array(mi.render(scene, seed=0), dtype=np.float64)
    # Mitsuba numbers shapes from 1 in an order of its own; the backdrop is 0.
    number = 1 + [shape.id() for shape in scene.shapes()].index("mesh")
    return found[..., 3], found[..., 4:7], found[..., 7:10], np.abs(found[..., 10] - number) < 1e-3


# --- Comparing ----------------------------------------------------------------------------------------------


def neighbourhood(values, reduce, radius=1):
    """`reduce` over the square of pixels around each."""
    padded = np.pad(values, radius, mode="edge")
    size = 2 * radius + 1
    return reduce(np.lib.stride_tricks.sliding_window_view(padded, (size, size)), axis=(2, 3))


def kept(picture, noise, hits, arguments):
    """Pixels that are neither backdrop, silhouette nor shadow edge nor near to one."""
    cover, position, normal, on_mesh = hits
    distance = np.linalg.norm(position - arguments.eye, axis=-1)
    span = lambda values: neighbourhood(values, np.max) - neighbourhood(values, np.min)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    around = np.stack([neighbourhood(normal[..., axis], lambda window, axis: window) for axis in range(3)], -1)
    cosine = np.einsum("yxijc,yxc->yxij", around, normal).min((2, 3))
    silhouette = (cover < 0.999) | (span(on_mesh * 1.0) > 0) | (span(distance) > 0.05 * distance)
    silhouette |= cosine < np.cos(np.radians(30))
    albedo = np.where(on_mesh, MESH_ALBEDO, GROUND_ALBEDO)
    irradiance, noise = picture.mean(-1) / albedo, noise / albedo
    edge = span(irradiance) > arguments.edge * neighbourhood(irradiance, np.max) + 6 * neighbourhood(noise, np.mean, 2)
    return neighbourhood(silhouette | edge, np.max, arguments.margin) == 0


def write_png(path, linear):
    mi.Bitmap(linear.astype(np.float32)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, True).write(str(path))


def give_up(message):
    print(f"compare.py: {message}", file=sys.stderr)
    sys.exit(2)


def compare(arguments):
    output = Path(arguments.output)
    output.mkdir(parents=True, exist_ok=True)
    positions, triangles = read_obj(arguments.mesh)
    low, high = positions.min(0), positions.max(0)
    if arguments.target is None:
        arguments.target = list((low + high) / 2)
    if arguments.eye is None:
        arguments.eye = list(np.array(arguments.target) + np.linalg.norm(high - low) * np.array([0.5, 0.55, 0.95]))
    mesh, picture = output / "mesh.ply", output / "lightcast.exr"
    write_ply(mesh, positions, smooth_normals(positions, triangles), triangles)
    if arguments.picture:
        picture = arguments.picture
    else:
        command = [str(word) for word in lightcast_command(arguments, mesh, picture)]
        if (code := subprocess.run(command).returncode) != 0:
            give_up(f"exit code {code} of {' '.join(command)}")
    ours = np.array(mi.Bitmap(str(picture)), dtype=np.float64)[..., :3]
    if ours.shape[:2] != tuple(arguments.size[::-1]):
        give_up(f"{picture} is {ours.shape[1]} x {ours.shape[0]}, not {arguments.size}")

    latlong = averaged(np.array(mi.Bitmap(str(arguments.map)), dtype=np.float64)[..., :3])
    latlong[ROWS // 2 :] = 0
    shapes = {"mesh": {"type": "ply", "filename": str(mesh), "bsdf": lambert(MESH_ALBEDO)}, "plane": ground(low, high)}
    halves = [render(shapes, arguments, latlong, arguments.samples // 2, seed) for seed in (1, 2)]
    theirs = (halves[0] + halves[1]) / 2
    hits = first_hits(shapes, arguments)
    keep = kept(theirs, np.abs(halves[0] - halves[1]).mean(-1) / 2, hits, arguments)
    surface, on_mesh = hits[0] > 0.5, hits[3]
    if not keep.any():
        give_up("no pixel is left to compare")

    floor = 0.05 * theirs[keep].mean()
    relative = lambda difference: np.abs(difference).mean(-1) / np.maximum(theirs.mean(-1), floor)
    error, noise = relative(ours - theirs), relative(halves[0] - halves[1]) / 2
    part = lambda values, where: f"{values[where].mean():.4f}" if where.any() else "-"
    print(f"mean relative error outside of shadow edges   {error[keep].mean():.4f} (limit {LIMIT})")
    print(f"  99th percentile                             {np.quantile(error[keep], 0.99):.4f}")
    print(f"  on the mesh, on the ground                  {part(error, keep & on_mesh)} {part(error, keep & ~on_mesh)}")
    print(f"  of which the path tracer's noise            {noise[keep].mean():.4f}")
    print(f"brightness, lightcast to mitsuba              {ours[keep].mean() / theirs[keep].mean():.4f}")
    print(f"share of surface pixels left out              {1 - keep.sum() / surface.sum():.3f}")
    print(f"mean relative error with all surface pixels   {error[surface].mean():.4f}")
    exposure = 0.7 / np.quantile(theirs[surface], 0.98)
    write_png(output / "lightcast.png", ours * exposure)
    write_png(output / "mitsuba.png", theirs * exposure)
    # 10 % is white; what is left out is blue.
    grey = np.clip(error / 0.1, 0, 1)[..., None] * np.ones(3)
    write_png(output / "difference.png", np.where(keep[..., None], grey, grey * 0.3 + [0, 0, 0.25]))
    return 0 if error[keep].mean() <= LIMIT else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--self-test", action="store_true", help="check orientation and radiometry, without lightcast")
    parser.add_argument("--lightcast", default="target/release/lightcast", help="the program [%(default)s]")
    parser.add_argument("--map", help="lat-long panorama, .hdr or .exr without the attribute `envmap`")
    parser.add_argument("--mesh", help="OBJ file")
    parser.add_argument("--picture", help="compare this EXR instead of calling lightcast")
    parser.add_argument("--output", default="target/path_tracer", help="folder for pictures and the mesh [%(default)s]")
    parser.add_argument("--size", type=lambda s: tuple(int(n) for n in s.split("x")), default=(256, 192))
    vector = lambda text: [float(number) for number in text.split(",")]
    parser.add_argument("--eye", type=vector, help="--eye=x,y,z [above and before the mesh]")
    parser.add_argument("--target", type=vector, help="--target=x,y,z [the middle of the mesh]")
    parser.add_argument("--fov", type=float, default=40.0, help="vertical field of view in degrees [%(default)s]")
    parser.add_argument("--samples", type=int, default=2048, help="samples of either part of the map [%(default)s]")
    parser.add_argument("--edge", type=float, default=0.15, help="change of irradiance at shadow edges [%(default)s]")
    parser.add_argument("--margin", type=int, default=2, help="px around edges that are left out [%(default)s]")
    arguments = parser.parse_args()
    if arguments.self_test:
        from self_test import self_test

        return self_test()
    if not arguments.map or not arguments.mesh:
        parser.error("--map and --mesh are needed")
    return compare(arguments)


if __name__ == "__main__":
    sys.exit(main())
