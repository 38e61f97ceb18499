"""Ray casting of a tube: the exact depth that a grid of rays meets, before any sensor adds its noise."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dlogen.evaluation.centre_line import CentreLine
from dlogen.geometry.vectors import dots
from dlogen.types import Array, IntArray

#: Spheres along the axis this many radii apart: their union is within 1e-3 radii of a straight tube.
SPHERE_SPACING = 0.08

#: Spheres that are only a start: their union is within 1e-2 radii of a straight tube.
_COARSE_SPACING = 0.25

#: Ray-sphere pairs that are worked on at a time.
_PAIRS = 500_000


def exact_depth(line: CentreLine, radius: float, rays: Array, focal: tuple[float, float]) -> tuple[Array, Array]:
    """As `tube_depth`, with the depth of the tube itself instead of that of spheres, and faster for wide tubes."""
    depth, cosine = tube_depth(line, radius, rays, focal, _COARSE_SPACING)
    hit = np.flatnonzero(np.isfinite(depth))
    ray, start = rays.reshape(-1, 3)[hit], depth.ravel()[hit]
    towards = np.linalg.norm(ray, axis=1)
    count = max(8, int(np.ceil(line.length / (_COARSE_SPACING * radius)))) + 1
    knots = np.linspace(0.0, 1.0, count)
    centres, tangents = line(knots), line.tangents(knots)
    step = line.length / (count - 1)
    s = step * cKDTree(centres).query(ray * start[:, None])[1]
    t = start

    def foot(s: Array) -> tuple[Array, Array]:
        cell = np.clip((s / step).astype(np.intp), 0, count - 2)
        return _hermite(centres, tangents, cell, s / step - cell, step)

    inside = np.ones(len(t), dtype=bool)
    for _ in range(5):
        # The foot point on the axis, then Newton along the ray on the distance from it.
        point = ray * t[:, None]
        for _ in range(2):
            centre, tangent = foot(s)
            s = s + dots(point - centre, tangent)
            # Beyond the ends there is no tube.
            inside &= (s > 0.0) & (s < line.length)
            s = np.clip(s, 0.0, line.length)
        offset = point - foot(s)[0]
        distance = np.linalg.norm(offset, axis=1)
        slope = dots(offset, ray) / distance
        # On the flat ends and where the ray only grazes the tube the start stays.
        mended = inside & (slope < -0.1 * towards) & (np.abs(t - start) < 0.1 * radius)
        change = (distance - radius) / np.where(mended, slope, -1.0)
        t = np.where(mended, t - np.clip(change, -0.1 * radius, 0.1 * radius), start)
    depth.ravel()[hit] = t
    cosine.ravel()[hit] = np.where(mended, -slope / towards, cosine.ravel()[hit])
    return depth, cosine


def _hermite(points: Array, tangents: Array, cell: IntArray, u: Array, step: float) -> tuple[Array, Array]:
    """Points and unit tangents of the cubic pieces between points that are `step` of arc length apart."""
    u = u[:, None]
    a, b, m, n = points[cell], points[cell + 1], step * tangents[cell], step * tangents[cell + 1]
    place = (1 + 2 * u) * (1 - u) ** 2 * a + u * (1 - u) ** 2 * m + u**2 * (3 - 2 * u) * b - u**2 * (1 - u) * n
    slope = 6 * u * (1 - u) * (b - a) + (1 - 4 * u + 3 * u**2) * m + (3 * u**2 - 2 * u) * n
    return place, slope / np.linalg.norm(slope, axis=1, keepdims=True)


def tube_depth(
    line: CentreLine, radius: float, rays: Array, focal: tuple[float, float], spacing: float = SPHERE_SPACING
) -> tuple[Array, Array]:
    """Depth of the tube's nearest surface and the cosine of the angle at which it is seen; inf and 0 where none is.

    The tube is a row of spheres, of which a ray hits the nearest; what a sphere at an end has beyond the end's plane is
    cut off, and a disc put there instead.

    Args:
        line: the axis in the camera frame: x right, y down, z forward, all of it before the camera.
        radius: of the tube, metres.
        rays: (height, width, 3) directions of the pixels with z = 1; the optical axis is in the middle.
        focal: focal lengths in pixels, of columns and of rows.
        spacing: of the spheres, radii.

    Returns:
        (height, width) each.
    """
    height, width = rays.shape[:2]
    rays = rays.reshape(-1, 3)
    depth, cosine = np.full(len(rays), np.inf), np.zeros(len(rays))

    def see(pixel: IntArray, t: Array, normal: Array) -> None:
        """Keep what is nearer than what was there: pixels (K,), depths (K,), outward unit normals (K, 3)."""
        # Of several values for one pixel the last one written stays: the nearest.
        order = np.argsort(t)[::-1]
        order = order[t[order] < depth[pixel[order]]]
        pixel, ray = pixel[order], rays[pixel[order]]
        depth[pixel] = t[order]
        cosine[pixel] = -dots(normal[order], ray) / np.linalg.norm(ray, axis=1)

    caps = [
        (s, line(s)[0], direction * line.tangents(s)[0]) for s, direction in ((0.0, -1.0), (1.0, 1.0))
    ]  # material coordinate, centre, outward normal
    for _, end, outward in caps:
        facing = np.flatnonzero(rays @ outward < 0.0)
        t = (end @ outward) / (rays[facing] @ outward)
        on_disc = np.linalg.norm(rays[facing] * t[:, None] - end, axis=1) <= radius
        see(facing[on_disc], t[on_disc], np.broadcast_to(outward, (int(on_disc.sum()), 3)))

    count = max(2, int(np.ceil(line.length / (spacing * radius))))
    s = np.linspace(0.0, 1.0, count)
    centres = line(s)
    # A rectangle of pixels around each centre that holds the whole sphere, perspective included.
    nearest = float(centres[:, 2].min()) - radius
    across, down = (np.arange(-n, n + 1) for n in (int(np.ceil(1.2 * f * radius / nearest)) + 1 for f in focal))
    offsets = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    middle = 0.5 * np.array([width - 1, height - 1])
    block = max(1, _PAIRS // len(offsets))
    for start in range(0, count, block):
        part = centres[start : start + block]
        place = np.round(np.array(focal) * part[:, :2] / part[:, 2:] + middle).astype(int)[:, None] + offsets
        owner = np.repeat(np.arange(len(part)), len(offsets))
        place = place.reshape(-1, 2)
        inside = ((place >= 0) & (place < [width, height])).all(axis=1)
        pixel: IntArray = place[inside, 0] + width * place[inside, 1]
        owner = owner[inside]
        ray, centre = rays[pixel], part[owner]
        # |t d - c|^2 = r^2 with d_z = 1, so that t is the depth.
        a = dots(ray, ray)
        b = dots(ray, centre)
        root = b * b - a * (dots(centre, centre) - radius**2)
        hit = root > 0.0
        t = (b[hit] - np.sqrt(root[hit])) / a[hit]
        pixel, owner, centre = pixel[hit], owner[hit] + start, centre[hit]
        point = rays[pixel] * t[:, None]
        kept = np.ones(len(t), dtype=bool)
        for s_end, end, outward in caps:
            at_end = np.abs(s[owner] - s_end) * line.length < 2.0 * radius
            kept &= ~(at_end & ((point - end) @ outward > 0.0))
        see(pixel[kept], t[kept], ((point - centre) / radius)[kept])
    return depth.reshape(height, width), cosine.reshape(height, width)
