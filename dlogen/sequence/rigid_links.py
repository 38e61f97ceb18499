"""Rigid links fitted to curves: one chain of constant link lengths for every shape that the object takes.

Joints that lie on the curve, a chord's length apart (paper Eq. 18-20), are other places of the object in every capture:
the more it bends, the more of it a chord spans. Here a link is as long as the piece of the object that it stands for,
so that joints are material points. Where the object bends they lie a little outside the curve, and the curve runs on
both sides of its chain, as a circle does between the corners and the sides of a polygon of the same circumference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from dlogen.geometry.segments import distances
from dlogen.geometry.vectors import dots, unit
from dlogen.types import Array

#: Gauss-Legendre nodes and weights on [0, 1] for what is integrated over a link.
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(8) + np.array([[1.0], [0.0]])) / 2.0

#: Samples of a link in which deviations are measured, ends included.
_SAMPLES = 17

#: Steps that move no joint by more than this share of the longest link end the fit.
_DONE = 1e-10
_MOST_STEPS = 40

#: Numbers of links up to which every one is tried.
_ALL_TRIED = 50


def equal_links(length: float, count: int) -> Array:
    """(count,) equal lengths."""
    return np.full(count, length / count)


def links_of_length(length: float, link: float) -> Array:
    """(n,) lengths of `link` each but for the last, which has what is left."""
    count = max(1, math.ceil(length / link - 1e-9))
    last = length - (count - 1) * link
    return np.concatenate([np.full(count - 1, link), [last]])


@dataclass(frozen=True, eq=False)
class Shape:
    """Curves that show an object, with what says where on it they lie.

    Attributes:
        curves: (F, K, 3) points even in arc length, metres.
        lengths: (F,) arc lengths of the curves.
        length: of the object, metres.
        start: (F,) where on the object the curves begin; negative where they begin before it.
    """

    curves: Array
    lengths: Array
    length: float
    start: Array

    def points(self, coordinates: Array) -> Array:
        """Points of the object by distance along it: (C,) metres -> (F, C, 3).

        Beyond the ends of a curve the object goes on straight.
        """
        last = self.curves.shape[1] - 1
        u = (coordinates - self.start[:, None]) / self.lengths[:, None] * last
        i = np.clip(u.astype(np.intp), 0, last - 1)
        t = (u - i)[..., None]
        row = np.arange(len(self.curves))[:, None]
        points: Array = (1.0 - t) * self.curves[row, i] + t * self.curves[row, i + 1]
        return points

    def of(self, captures: list[int]) -> Shape:
        """Some of them."""
        return Shape(self.curves[captures], self.lengths[captures], self.length, self.start[captures])


def fit_links(shape: Shape, links: Array) -> Array:
    """Chains of these links nearest to the curves in the mean square over the object.

    Minimises the integral of |q(sigma) - f(sigma)|^2 over each object, where the chain's point q(sigma) lies between
    the joints x_i that enclose sigma, subject to |x_(i+1) - x_i| = l_i. Gauss-Newton steps with Lagrange multipliers
    (Nocedal & Wright, Numerical Optimization, section 18.1); the equations of all captures are one banded system.

    Args:
        shape: the curves.
        links: (n,) link lengths, metres.

    Returns:
        (F, n + 1, 3) joints. Link lengths are exact to rounding.
    """
    count, captures = len(links), len(shape.curves)
    ends = np.concatenate([[0.0], np.cumsum(links)])
    target = shape.points((ends[:-1, None] + links[:, None] * _NODES).ravel()).reshape(captures, count, len(_NODES), 3)
    right = np.zeros((captures, count + 1, 3))
    right[:, :-1] += np.einsum("fckx,k->fcx", target, _WEIGHTS * (1.0 - _NODES)) * links[:, None]
    right[:, 1:] += np.einsum("fckx,k->fcx", target, _WEIGHTS * _NODES) * links[:, None]
    joints = _of_lengths(shape.points(ends), links)
    tension = np.zeros((captures, count))
    active = np.arange(captures)
    for _ in range(_MOST_STEPS):
        step, tension[active] = _step(joints[active], links, right[active], tension[active])
        # A link may turn by half a radian at most: the constraint is linear only nearby.
        turn = (np.linalg.norm(np.diff(step, axis=1), axis=2) / links).max(axis=1)
        step *= np.minimum(1.0, 0.5 / np.maximum(turn, 1e-300))[:, None, None]
        joints[active] = _of_lengths(joints[active] + step, links)
        moved = np.abs(step).max(axis=(1, 2)) > _DONE * links.max()
        active = active[moved]
        if not len(active):
            break
    return joints


def _step(joints: Array, links: Array, right: Array, tension: Array) -> tuple[Array, Array]:
    """Newton's step of the joints and the new multipliers, (F, n + 1, 3) and (F, n).

    H dx + C^T lambda = b - M x and C dx = -c, where M is the mass matrix of the hat functions, c the constraints
    (|e|^2 - l^2) / 2 of the links e, and H = M + sum lambda_i grad^2 c_i with pushes left out: H stays positive
    definite. In the order x_0, lambda_0, x_1, lambda_1, ... nothing is farther than four places from the diagonal.
    """
    captures, count = joints.shape[0], len(links)
    size = 4 * (count + 1)
    edges = np.diff(joints, axis=1)
    pull = np.maximum(tension, 0.0)
    diagonal, beside = np.zeros((captures, count + 1)), links / 6.0 - pull
    diagonal[:, :-1] += links / 3.0 + pull
    diagonal[:, 1:] += links / 3.0 + pull
    # bands[4 + row - column, capture, column]
    bands = np.zeros((9, captures, count + 1, 4))
    bands[4, :, :, :3] = diagonal[..., None]
    bands[4, :, -1, 3] = 1.0  # there is no link after the last joint
    bands[8, :, :-1, :3] = beside[..., None]
    bands[0, :, 1:, :3] = beside[..., None]
    for axis in range(3):
        bands[4 + 3 - axis, :, :-1, axis] = -edges[..., axis]  # row lambda_i, column x_i
        bands[4 - 1 - axis, :, 1:, axis] = edges[..., axis]  # row lambda_i, column x_(i+1)
        bands[4 - 3 + axis, :, :-1, 3] = -edges[..., axis]  # row x_i, column lambda_i
        bands[4 + 1 + axis, :, :-1, 3] = edges[..., axis]  # row x_(i+1), column lambda_i
    known = np.zeros((captures, count + 1, 4))
    known[..., :3] = right
    known[:, :-1, :3] -= links[:, None] * (joints[:, :-1] / 3.0 + joints[:, 1:] / 6.0)
    known[:, 1:, :3] -= links[:, None] * (joints[:, :-1] / 6.0 + joints[:, 1:] / 3.0)
    known[:, :-1, 3] = 0.5 * (links**2 - dots(edges, edges))
    solved = solve_banded((4, 4), bands.reshape(9, captures * size), known.ravel()).reshape(captures, count + 1, 4)
    return solved[..., :3], solved[:, :-1, 3]


def _of_lengths(joints: Array, links: Array) -> Array:
    """The same directions with exact lengths, about the same centre of mass."""
    edges = np.diff(joints, axis=1)
    return from_directions(centre(joints, links), unit(edges), links)


def centre(joints: Array, links: Array) -> Array:
    """Centres of mass of chains: (F, n + 1, 3) -> (F, 3)."""
    middles = 0.5 * (joints[:, :-1] + joints[:, 1:])
    result: Array = np.einsum("fcx,c->fx", middles, links) / links.sum()
    return result


def from_directions(centres: Array, directions: Array, links: Array) -> Array:
    """Joints of chains: centres of mass (F, 3), unit vectors (F, n, 3), (n,) -> (F, n + 1, 3)."""
    joints = np.zeros((len(directions), len(links) + 1, 3))
    np.cumsum(directions * links[:, None], axis=1, out=joints[:, 1:])
    return joints + (centres - centre(joints, links))[:, None]


def deviations(shape: Shape, joints: Array, links: Array) -> Array:
    """The largest distance between each curve and its chain, metres: (F,).

    As `dlogen.stages.chain.deviation`: of a point of the curve to the link that its piece belongs to, and of a joint
    to the two pieces that meet there.
    """
    captures, count = len(joints), len(links)
    ends = np.concatenate([[0.0], np.cumsum(links)])
    at = ends[:-1, None] + links[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
    pieces = shape.points(at.ravel()).reshape(captures, count, _SAMPLES, 3)
    of_curve = distances(pieces, joints[:, :-1, None], joints[:, 1:, None]).max(axis=(1, 2))
    # Joint i against piece i - 1 and piece i.
    own = distances(joints[:, :-1, None], pieces[:, :, :-1], pieces[:, :, 1:]).min(axis=2)
    before = distances(joints[:, 1:, None], pieces[:, :, :-1], pieces[:, :, 1:]).min(axis=2)
    of_joints = np.full((captures, count + 1), np.inf)
    of_joints[:, :-1] = own
    of_joints[:, 1:] = np.minimum(of_joints[:, 1:], before)
    result: Array = np.maximum(of_curve, of_joints.max(axis=1))
    return result


def fewest_links(shape: Shape, e_max: float, most: int) -> int | None:
    """The smallest number of equal links whose chains are within e_max of all curves; None beyond `most`.

    Tries every number up to 50. Beyond, numbers are passed over with which the deviation would still be twice e_max if
    it fell with the square of the number, as it does for links that are short against the bends. The curve that was too
    far with the number before is tried first.
    """
    worst, count = 0, 1
    while count <= most:
        links = equal_links(shape.length, count)
        for part in ([worst], list(range(len(shape.curves)))):
            found = deviations(shape.of(part), fit_links(shape.of(part), links), links)
            largest = float(found.max())
            if largest > e_max:
                worst = part[int(np.argmax(found))]
                break
        else:
            return count
        count = max(count + 1, int(count * math.sqrt(0.5 * largest / e_max))) if count >= _ALL_TRIED else count + 1
    return None
