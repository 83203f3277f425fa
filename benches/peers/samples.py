"""The peers of our sampling: NumPy and Mitsuba; and how far samples are from the map's distribution."""

import mitsuba as mi
import numpy as np
from scipy.stats import qmc

mi.set_variant("scalar_rgb")


def halton(count):
    """From index 1 on: index 0 is the corner."""
    sampler = qmc.Halton(d=2, scramble=False)
    sampler.fast_forward(1)
    return sampler.random(count)


class NumpySampling:
    """Piecewise constant over the pixels of a hemisphere: row by the marginal, column within the row."""

    def __init__(self, columns, rows):
        self.columns, self.rows = columns, rows
        self.edges = 1 - np.cos(np.linspace(0, np.pi / 2, rows + 1))
        self.omega = (np.diff(self.edges) * 2 * np.pi / columns)[:, None]

    def update(self, values):
        """Values are densities per solid angle."""
        self.flux = (values * self.omega).ravel()
        # One running sum for all rows, from 0 on.
        self.cdf = np.concatenate(([0.0], np.cumsum(self.flux)))
        self.row_cdf = self.cdf[:: self.columns]

    def sample(self, points):
        """z = 1 - cos theta and phi for points of the unit square."""
        wanted = points[:, 1] * self.row_cdf[-1]
        row = np.searchsorted(self.row_cdf[1:-1], wanted, side="right")
        start, total = self.row_cdf[row], self.row_cdf[row + 1] - self.row_cdf[row]
        z = self.edges[row] + (wanted - start) / total * (self.edges[row + 1] - self.edges[row])
        within = start + points[:, 0] * total
        pixel = np.searchsorted(self.cdf[1:-1], within, side="right")
        column = pixel - row * self.columns + (within - self.cdf[pixel]) / self.flux[pixel]
        return np.stack((z, column * (2 * np.pi / self.columns)), axis=-1)

    def pdf(self, positions):
        """Density per solid angle."""
        row = np.clip(np.searchsorted(self.edges, positions[:, 0], side="right") - 1, 0, self.rows - 1)
        column = np.clip((positions[:, 1] * self.columns / (2 * np.pi)).astype(int), 0, self.columns - 1)
        values = self.flux.reshape(self.rows, self.columns) / self.omega
        return values[row, column] / self.row_cdf[-1]

    def ground(self, values, points):
        """Irradiance of a surface that faces up by samples of equal power."""
        self.update(values)
        return self.row_cdf[-1] * np.mean(1 - self.sample(points)[:, 0])


def cdf_error(numpy, positions):
    """Largest difference of the cumulative distributions in z and phi, of samples and of the map, at pixels' corners."""
    azimuths = np.linspace(0, 2 * np.pi, numpy.columns + 1)
    counts = np.histogram2d(positions[:, 0], positions[:, 1], (numpy.edges, azimuths))[0] / len(positions)
    wanted = numpy.flux.reshape(counts.shape) / numpy.row_cdf[-1]
    cumulative = lambda parts: parts.cumsum(axis=0).cumsum(axis=1)
    return np.abs(cumulative(counts) - cumulative(wanted)).max()


def irradiance_error(numpy, positions):
    """Relative error of the irradiance of a surface that faces up, all samples having the same power. The map's own
    has the exact mean cosine of every row."""
    cosine = 1 - (numpy.edges[1:] + numpy.edges[:-1]) / 2
    exact = (numpy.flux.reshape(numpy.rows, -1).sum(axis=1) * cosine).sum() / numpy.row_cdf[-1]
    return abs(np.mean(1 - positions[:, 0]) / exact - 1)


class Envmap:
    def __init__(self, emitter):
        self.emitter = emitter
        self.place = mi.SurfaceInteraction3f()
        self.place.p = [0, 0, 0]

    def _calls(self, emitter, points):
        points = [mi.Point2f(*point) for point in points]
        return lambda: [emitter.sample_direction(self.place, point) for point in points]

    def sampler(self, points):
        return self._calls(self.emitter, points)

    def bare_calls(self, points):
        """The same calls of an emitter that has next to nothing to do."""
        return self._calls(mi.load_dict({"type": "constant"}), points)

    def sample(self, points):
        """z and phi, and densities per solid angle."""
        samples = [sample for sample, _ in self.sampler(points)()]
        x, y, z = np.array([sample.d for sample in samples]).T
        return np.stack((1 - y, np.arctan2(z, x) % (2 * np.pi)), axis=-1), np.array([s.pdf for s in samples])


def mitsuba_envmap(values, finer):
    """Mitsuba's emitter for a hemisphere. Its orientation is OpenEXR's: column u in [0, 1) is phi = 2 pi u - pi/2. It
    interpolates between pixels, of which the first and last row lie on the poles; `finer` pixels for each of ours
    bring it nearer to pixels that are constant."""
    latlong = np.concatenate((np.roll(values, values.shape[1] // 4, axis=1), np.zeros_like(values)))
    rows = np.repeat(latlong, finer, axis=0)
    rows = np.concatenate([rows[:1], (rows[1:] + rows[:-1]) / 2, rows[-1:]])
    pixels = np.repeat(np.repeat(rows, finer, axis=1)[..., None], 3, axis=2)
    return Envmap(mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(pixels.astype(np.float32))}))
