"""Times and checks our work beside what a user would pick instead, one thread each: `make bench-peers`.

A ratio is the peer's median over ours, of processor time; both sides run in turns, so that they meet the same noise.

- *Frame to polar*: a 12-bit logarithmic frame of a fisheye with a sky and a sun of the real one's size, towards 16
  directions. OpenCV: table, `remap` at the centres of the map's pixels; and, for power that is kept, `remap` at about
  as many places as the frame has pixels, then the mean by `resize`. Errors are relative to the frame's exact integral.
- *Samples*: NumPy's `cumsum` and `searchsorted`, piecewise constant as ours are, and Mitsuba's `envmap`.
- *Equality*: SciPy's Halton points and Parks-McClellan taps, OpenEXR's pixels.
"""

import argparse
import os
import platform
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

import cv2
import mitsuba
import numpy as np
import OpenEXR
import scipy

from frames import Scene
from race import Lightcast, Table, race, timed
from samples import NumpySampling, cdf_error, halton, irradiance_error, mitsuba_envmap

cv2.setNumThreads(1)
OpenEXR.set_global_thread_count(0)

FRAMES = [(640, 480), (2880, 2880)]
MAPS = [(360, 90), (1440, 360)]
SAMPLES = 300


def opencv_steps(scene, table, columns, rows):
    """Name, what makes a map of a frame, for the ways in which OpenCV does it."""
    radiance = np.empty((scene.height, scene.width), np.float32)
    # As many sample positions as the frame has pixels along a meridian.
    finer = 1
    while rows * finer < 0.5 * scene.height:
        finer *= 2

    def mapping(finer):
        # Fixed-point maps, as OpenCV recommends for speed.
        maps = cv2.convertMaps(*scene.opencv_maps(columns * finer, rows * finer), cv2.CV_16SC2)
        return maps, np.empty((rows * finer, columns * finer), np.float32)

    (places, map_), (fine_places, fine) = mapping(1), mapping(finer)

    def look_up(frame):
        cv2.LUT(frame, table, dst=radiance)
        return cv2.remap(radiance, *places, cv2.INTER_LINEAR, dst=map_)

    def average(frame):
        cv2.LUT(frame, table, dst=radiance)
        cv2.remap(radiance, *fine_places, cv2.INTER_LINEAR, dst=fine)
        return cv2.resize(fine, (columns, rows), dst=map_, interpolation=cv2.INTER_AREA)

    steps = [("table, remap", look_up)]
    if finer > 1:
        steps.append((f"table, remap x{finer * finer}, mean", average))
    return steps


def frame_to_polar(lightcast, table, folder):
    """Frame to polar map, and on to samples."""
    chains = []
    table.section("raw frame to polar map", "error of power, of the sun's: ours; peer's")
    for width, height in FRAMES:
        scene, exact = Scene(width, height, folder), None
        for columns, rows in MAPS:
            files = {"table": folder / "table.f32", "maps": folder / "maps.f32"}
            case = {"calibration": scene.calibration, "columns": columns, "rows": rows}
            answer = lightcast.ask(case="frame-to-polar", frames=scene.files, **case, **files)
            radiance = np.fromfile(files["table"], np.float32)
            maps = np.fromfile(files["maps"], np.float32).reshape(-1, rows, columns)
            exact = exact or scene.exact(radiance)
            ours, frame = scene.errors(maps, exact), scene.frames[1]
            name = f"{width}x{height} to {columns}x{rows}"
            steps = opencv_steps(scene, radiance, columns, rows)
            for peer, step in steps:
                theirs = scene.errors(np.array([step(frame).copy() for frame in scene.frames]), exact)
                times = race(lightcast.repeat, timed(lambda: step(frame)))
                table.row(name, f"OpenCV {peer}", *times, f"{errors(ours)}; {errors(theirs)}")
            chains.append((scene, exact, case, name, steps, maps))
            streamed = Lightcast(lightcast.process.args)
            streamed.ask(case="stream", bytes=answer["bytes"])
            times = race(lightcast.repeat, streamed.repeat)
            streamed.close()
            table.row(name, "reading frame and matrix once", *times, f"{answer['bytes'] / 1e6:.1f} MB")
    table.section(f"raw frame to {SAMPLES} samples", "error of ground's irradiance: ours; peer's")
    points = halton(SAMPLES)
    for scene, exact, case, name, steps, maps in chains:
        lightcast.ask(case="chain", frame=scene.files[1], count=SAMPLES, samples=folder / "samples.f64", **case)
        numpy = NumpySampling(case["columns"], case["rows"])
        ours = scene.ground_error([numpy.ground(map_, points) for map_ in maps], exact["ground"])
        for peer, step in steps:
            theirs = [numpy.ground(step(frame), points) for frame in scene.frames]
            theirs = scene.ground_error(theirs, exact["ground"])

            def chain(frame=scene.frames[1], step=step):
                numpy.update(step(frame))
                return numpy.sample(points)

            times = race(lightcast.repeat, timed(chain))
            table.row(name, f"OpenCV {peer}, NumPy", *times, f"{ours:.1e}; {theirs:.1e}")
    return chains


def errors(pair):
    return ", ".join(f"{error:.1e}" for error in pair)


def sampling(lightcast, table, folder, maps):
    """CDFs and samples of maps with a sun."""
    values_file, points_file, samples_file = folder / "values.f32", folder / "points.f64", folder / "samples.f64"
    table.section("polar map to samples", "error of CDF, of ground's irradiance: ours; peer's")
    for values in maps:
        rows, columns = values.shape
        values.tofile(values_file)
        numpy = NumpySampling(columns, rows)
        numpy.update(values)
        for inversion in ("standard", "bicontinuous"):
            name = f"{inversion}, {columns}x{rows}"
            for count in (300, 1000, 100_000):
                points = halton(count)
                points.tofile(points_file)
                request = {"inversion": inversion, "columns": columns, "rows": rows, "values": values_file}
                request |= {"points": points_file, "samples": samples_file}
                if count == 300:
                    lightcast.ask(case="sampling", part="cdf", **request)
                    times = race(lightcast.repeat, timed(lambda: numpy.update(values)))
                    table.row(name, "NumPy: CDFs by cumsum", *times)
                lightcast.ask(case="sampling", part="samples", **request)
                ours = np.fromfile(samples_file).reshape(-1, 3)
                theirs = numpy.sample(points)
                times = race(lightcast.repeat, timed(lambda: numpy.sample(points)))
                remark = f"{distance(numpy, ours)}; {distance(numpy, theirs)}"
                if inversion == "standard":
                    remark += f"; positions within {np.abs(ours[:, :2] - theirs).max():.0e}"
                table.row(name, f"NumPy: {count:,} by searchsorted", *times, remark)
                if (inversion, count) == ("standard", 1000):
                    envmap = mitsuba_envmap(values, 1)
                    times = race(lightcast.repeat, timed(envmap.sampler(points)))
                    call_ms = race(timed(envmap.bare_calls(points)))[0]
                    drawn, densities = mitsuba_envmap(values, 4).sample(points)
                    apart = np.median(np.abs(densities / numpy.pdf(drawn) - 1))
                    remark = f"{distance(numpy, ours)}; {distance(numpy, drawn)}; densities within {apart:.1%} (median)"
                    table.row(name, f"Mitsuba: {count:,} from Python", *times, remark)
                    print(f"    so long do as many calls of a `constant` emitter take:{call_ms:27.4f}")


def distance(numpy, positions):
    return errors((cdf_error(numpy, positions), irradiance_error(numpy, positions)))


def equality(lightcast, table, folder):
    """Points, taps and pixels that are to be the same."""
    table.section("the same numbers", "largest difference")
    file = folder / "points.f64"
    lightcast.ask(case="halton", count=100_000, points=file)
    points = np.fromfile(file).reshape(-1, 2)
    times = race(lightcast.repeat, timed(lambda: halton(100_000)))
    table.row("100,000 Halton points", "SciPy qmc.Halton", *times, f"{np.abs(points - halton(100_000)).max():.0e}")
    for rate, order in ((25.0, 8), (60.0, 20)):
        lightcast.ask(case="taps", frame_rate_hz=rate, taps=file)
        for density in (16, 1024):

            def remez():
                taps = scipy.signal.remez(order + 1, [0, 7, 9.6, rate / 2], [1, 0], fs=rate, grid_density=density)
                return taps / taps.sum()

            times = race(lightcast.repeat, timed(remez))
            difference = np.abs(np.fromfile(file) - remez()).max()
            table.row(f"taps at {rate:g} Hz", f"SciPy remez, grid density {density}", *times, f"{difference:.0e}")


def read_exr(file):
    with OpenEXR.File(str(file)) as picture:
        return picture.channels()["RGB"].pixels


def open_exr(lightcast, table, folder):
    """Sequences of lat-long pictures, written by us and by OpenEXR."""
    width, height, count = 1024, 512, 16
    table.section(f"reading {count} OpenEXR files of {width}x{height}, RGB", "MB/s of pixels: ours; peer's; pixels")
    random = np.random.default_rng(1)
    theta, phi = np.meshgrid(np.linspace(0, np.pi, height), np.linspace(0, 2 * np.pi, width), indexing="ij")
    kinds = {"half, ZIP, written by us": None, "half, PIZ": ("PIZ", np.float16), "float, none": ("NO", np.float32)}
    for kind, (name, by_peer) in enumerate(kinds.items()):
        files = [folder / f"sequence_{kind}_{number:04}.exr" for number in range(count)]
        for number, file in enumerate(files):
            sky = 1 + 0.5 * np.sin(3 * phi + 0.1 * number) * np.cos(5 * theta)
            sky += 1e4 * (np.hypot(theta - 0.7, phi - 2 - 0.01 * number) < 0.01)
            noisy = sky[..., None] * random.normal(1, 0.01, (height, width, 3))
            pixels = noisy.astype(np.float32)
            if by_peer is None:
                pixels.tofile(folder / "pixels.f32")
                request = {"samples": folder / "pixels.f32", "width": width, "height": height, "file": file}
                lightcast.ask(case="write", **request)
            else:
                header = {"compression": getattr(OpenEXR, f"{by_peer[0]}_COMPRESSION"), "type": OpenEXR.scanlineimage}
                OpenEXR.File(header, {"RGB": pixels.astype(by_peer[1])}).write(str(file))
        lightcast.ask(case="read", files=files, samples=folder / "read.f32")
        ours = np.fromfile(folder / "read.f32", np.float32).reshape(count, height, width, 3)
        theirs = np.array([read_exr(file) for file in files])
        times = race(lightcast.repeat, timed(lambda: [read_exr(file) for file in files]))
        speeds = "; ".join(f"{theirs.nbytes / ms / 1e3:.0f}" for ms in times)
        equal = "the same" if np.array_equal(ours, theirs.astype(np.float32)) else "DIFFERENT"
        table.row(name, "OpenEXR", *times, f"{speeds}; {equal}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("target/peers/files"), help="for inputs and results")
    parser.add_argument("command", nargs="+", help="what starts lightcast's side, after --")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    processor = next((line for line in open("/proc/cpuinfo") if line.startswith("model name")), "").split(":")[-1].strip()
    print(f"{processor or platform.machine()}, {os.cpu_count()} cores, one thread each; medians of processor time, ratio: peer by ours")
    print(f"OpenCV {cv2.__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}, ", end="")
    print(f"Mitsuba {mitsuba.__version__}, OpenEXR {OpenEXR.__version__}, Python {platform.python_version()}")
    lightcast, table = Lightcast(arguments.command), Table()
    chains = frame_to_polar(lightcast, table, folder)
    # The maps of the small frame, with the sun of the frame that is timed.
    sampling(lightcast, table, folder, [maps[1] for *_, maps in chains[: len(MAPS)]])
    equality(lightcast, table, folder)
    open_exr(lightcast, table, folder)
    lightcast.close()


if __name__ == "__main__":
    main()
