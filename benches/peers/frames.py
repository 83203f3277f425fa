"""Raw frames of a fisheye that looks at a sky with a small sun, and their exact integrals."""

import json

import cv2
import numpy as np

# A 12-bit logarithmic sensor, code = A + B ln L.
A, B, BLACK_CLIP, SATURATION = 1500.0, 216.0, 10, 4095
SUN_RADIANCE, SUN_RADIUS_RAD = 6e4, 0.00463
SUNS = 16


class Scene:
    """Frames of one size: the first without the sun, the others with the sun in different directions."""

    def __init__(self, width, height, folder):
        self.width, self.height = width, height
        # Equidistant, 180 degrees across the shorter side; the centre in pixels with half-integer centres.
        self.focal_px = min(width, height) / np.pi
        self.centre_px = np.array([width / 2 + 0.3, height / 2 - 0.2])
        lens = {"model": "kannala-brandt", "width": width, "height": height, "k": [0.0] * 4, "field_of_view_deg": 180.0}
        lens |= {"fx": self.focal_px, "fy": self.focal_px, "cx": self.centre_px[0], "cy": self.centre_px[1]}
        response = {"model": "logarithmic", "a": A, "b": B, "black_clip_code": BLACK_CLIP, "saturation_code": SATURATION}
        self.calibration = folder / f"camera_{width}x{height}.json"
        self.calibration.write_text(json.dumps({"version": 1, "lens": lens, "response": response}))
        self.frames = self._frames()
        self.files = [folder / f"frame_{width}x{height}_{number}.u16" for number in range(len(self.frames))]
        for frame, file in zip(self.frames, self.files):
            frame.tofile(file)

    def _from_axis(self, x, y):
        """Plane coordinates in radians of places in pixels."""
        return (x - self.centre_px[0]) / self.focal_px, (y - self.centre_px[1]) / self.focal_px

    def _frames(self):
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        u, v = self._from_axis(x, y)
        theta, phi = np.hypot(u, v), np.arctan2(-v, u)
        sky = 0.3 + 0.3 * theta + 0.2 * np.sin(4 * phi) * np.cos(6 * theta)
        sky[theta > np.pi / 2] = 0.0
        frames = [encode(sky)]
        random = np.random.default_rng(7)
        for _ in range(SUNS):
            # Evenly over the sky, and clear of the rim by the width of a coarse map's pixel.
            sun_theta, sun_phi = np.arccos(random.uniform(np.cos(1.5), 1)), random.uniform(0, 2 * np.pi)
            frames.append(encode(sky + SUN_RADIANCE * self._sun(sun_theta, sun_phi)))
        return frames

    def _sun(self, theta, phi, finer=16):
        """Part of every pixel that the sun covers."""
        covered = np.zeros((self.height, self.width))
        sun_px = self.centre_px + self.focal_px * theta * np.array([np.cos(phi), -np.sin(phi)])
        reach = int(2 * SUN_RADIUS_RAD * self.focal_px) + 2
        left, top = np.floor(sun_px).astype(int) - reach
        size = 2 * reach + 1
        steps = (np.arange(size * finer) + 0.5) / finer
        u, v = self._from_axis(*np.meshgrid(left + steps, top + steps))
        cosine = np.cos(theta) * np.cos(np.hypot(u, v))
        cosine += np.sin(theta) * np.sin(np.hypot(u, v)) * np.cos(np.arctan2(-v, u) - phi)
        inside = cosine > np.cos(SUN_RADIUS_RAD)
        part = inside.reshape(size, finer, size, finer).mean(axis=(1, 3))
        y, x = (slice(max(0, at), min(at + size, most)) for at, most in ((top, self.height), (left, self.width)))
        covered[y, x] = part[y.start - top : y.stop - top, x.start - left : x.stop - left]
        return covered

    def _solid_angles(self):
        """Solid angle of every pixel within the field of view, and the same weighted with the cosine to the zenith:
        Gauss's rule in a pixel, and a fine grid where the rim cuts it."""
        nodes, weights = np.polynomial.legendre.leggauss(3)
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)

        def density(x, y):
            theta = np.hypot(*self._from_axis(x, y))
            inside = np.sinc(theta / np.pi) / self.focal_px**2 * (theta <= np.pi / 2)
            return np.array([inside, inside * np.cos(theta)])

        total = np.zeros((2, self.height, self.width))
        for dx, wx in zip(nodes, weights):
            for dy, wy in zip(nodes, weights):
                total += wx * wy / 4 * density(x + dx / 2, y + dy / 2)
        rim = np.abs(np.hypot(*self._from_axis(x, y)) - np.pi / 2) * self.focal_px < 0.75
        steps = (np.arange(64) + 0.5) / 64 - 0.5
        dx, dy = np.meshgrid(steps, steps)
        places = x[rim][:, None] + dx.ravel(), y[rim][:, None] + dy.ravel()
        total[:, rim] = density(*places).mean(axis=-1)
        return total

    def exact(self, radiance):
        """Power and irradiance of the ground of every frame, from what the codes say."""
        omega, ground = self._solid_angles()
        decoded = [radiance[frame].astype(np.float64) for frame in self.frames]
        sums = lambda weights: np.array([(values * weights).sum() for values in decoded])
        return {"power": sums(omega), "ground": sums(ground)}

    def errors(self, maps, exact):
        """RMS over the suns of the relative errors of the power and of the sun's part of it."""
        edges = np.cos(np.linspace(0, np.pi / 2, maps.shape[1] + 1))
        omega = -np.diff(edges) * 2 * np.pi / maps.shape[2]
        power = (maps.astype(np.float64).sum(axis=2) * omega).sum(axis=1)
        sun = lambda power: power[1:] - power[0]
        rms = lambda value, true: np.sqrt(np.mean((value / true - 1) ** 2))
        return rms(power[1:], exact["power"][1:]), rms(sun(power), sun(exact["power"]))

    def ground_error(self, irradiances, exact):
        """RMS over the suns of the relative error of the ground's irradiance."""
        return np.sqrt(np.mean((np.array(irradiances)[1:] / exact[1:] - 1) ** 2))

    def opencv_maps(self, columns, rows):
        """Where `remap` finds the centres of a map's pixels, by OpenCV's own projection."""
        theta = (np.arange(rows) + 0.5)[:, None] * (np.pi / 2 / rows)
        phi = (np.arange(columns) + 0.5)[None, :] * (2 * np.pi / columns)
        # World to camera: x to x, y up to z, z to -y.
        ray = [np.sin(theta) * np.cos(phi), -np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi]
        # OpenCV counts pixels from their centres.
        [cx, cy], f = self.centre_px - 0.5, self.focal_px
        points = np.stack(ray, axis=-1).reshape(-1, 1, 3)
        no = np.zeros(3)
        places, _ = cv2.fisheye.projectPoints(points, no, no, np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]]), np.zeros(4))
        return places.astype(np.float32).reshape(rows, columns, 2).transpose(2, 0, 1).copy()


def encode(radiance):
    with np.errstate(divide="ignore"):
        codes = np.rint(A + B * np.log(radiance))
    return np.clip(codes, BLACK_CLIP, SATURATION).astype(np.uint16)
