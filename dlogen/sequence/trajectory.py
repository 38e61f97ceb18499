"""The motion of an object: for each capture the pose of the base and the values of the joints of one shared model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlogen.config.sections import JointSettings
from dlogen.errors import ConfigError
from dlogen.geometry.rotations import quaternion, smallest_rotations
from dlogen.sequence.joint_values import base_rotations, hinge_values
from dlogen.sequence.shared_model import SharedModel
from dlogen.stages.chain import build_chain
from dlogen.types import Array, BoolArray, Chain, Joints, Pose


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of the shared model.

    Attributes:
        model: the shared one, and the captures that it was made from.
        times: (F,) seconds; None where there is no order in time.
        chain: the shared model in the reference capture.
        base_positions: (F, 3) metres; NaN for captures without a pose, here and below.
        base_rotations: (F, 3, 3).
        values: (F, n - 1, dof) radians.
        states: (F) "good", "interpolated" between good captures, "held" as the nearest good capture in time, or, where
            there is no time, "none".
    """

    model: SharedModel
    times: Array | None
    chain: Chain
    base_positions: Array
    base_rotations: Array
    values: Array
    states: tuple[str, ...]

    @property
    def posed(self) -> BoolArray:
        """(F,) captures that have a pose."""
        return np.array([state != "none" for state in self.states])

    @property
    def quaternions(self) -> Array:
        """(F, 4) of the base, w x y z; each with the sign that is nearer to the one before."""
        out = np.full((len(self.states), 4), np.nan)
        last = None
        for k in np.flatnonzero(self.posed).tolist():
            q = np.array(quaternion(self.base_rotations[k]))
            out[k] = last = -q if last is not None and q @ last < 0.0 else q
        return out

    def poses(self) -> tuple[Pose, ...]:
        """Those of the captures that have one, under the names of the captures.

        A model has poses called scanned and straight (`dlogen.multibody.model`): captures of that name get an
        underscore behind it.
        """
        return tuple(
            Pose(
                f"{name}_" if (name := self.model.captures[k].name) in ("scanned", "straight") else name,
                self.base_positions[k],
                self.base_rotations[k],
                self.values[k],
                None if self.times is None else float(self.times[k]),
            )
            for k in np.flatnonzero(self.posed).tolist()
        )


def motion_of(model: SharedModel, times: Array | None, settings: JointSettings) -> Motion:
    """Poses of the shared model in all captures that have a chain.

    The base turns from capture to capture by the smallest rotation, and the values of the joints are continuous in
    time. Without times, each capture is posed from the reference capture alone.

    Args:
        model: the shared one, with its chains.
        times: (F,) seconds, increasing.
        settings: of the joints; `dof` and `zero` are used.

    Raises:
        ConfigError: a good capture is bent more than `min_bend_radius` allows.
    """
    if not isinstance(settings.min_bend_radius, str):
        _check_bends(model, settings.min_bend_radius)
    links, reference = model.links, model.reference
    s = np.concatenate([[0.0], np.cumsum(links)]) / links.sum()
    s[-1] = 1.0
    chain = build_chain(Joints(s, model.joints[reference], float(links[0]), float(links[-1])), model.sizes.radius.value)
    own = chain.transforms[:, :3, :3]
    zero = (
        np.swapaxes(own[:-1], 1, 2) @ own[1:] if settings.zero == "scan" else np.tile(np.eye(3), (len(own) - 1, 1, 1))
    )

    states = _states(model.good, times is not None)
    posed = np.flatnonzero([state != "none" for state in states])
    directions = np.diff(model.joints[posed], axis=1) / links[:, None]
    first = int(np.searchsorted(posed, reference))
    if times is None:
        # As if each came right after the reference capture.
        turns = smallest_rotations(np.tile(own[0, :, 0], (len(posed), 1)), directions[:, 0])
        bases = turns @ own[0]
        found = [
            hinge_values(directions[[first, k]], bases[[first, k]], zero, settings.dof, 0)[1] for k in range(len(posed))
        ]
        posed_values = np.array(found)
    else:
        bases = base_rotations(directions[:, 0], own[0], first)
        posed_values = hinge_values(directions, bases, zero, settings.dof, first)

    count = len(states)
    rotations, values = np.full((count, 3, 3), np.nan), np.full((count, len(links) - 1, settings.dof), np.nan)
    rotations[posed], values[posed] = bases, posed_values
    return Motion(model, times, chain, model.joints[:, 0], rotations, values, states)


def _check_bends(model: SharedModel, radius: float) -> None:
    """Refuse a smallest bend radius that the recording contradicts, by the chords of a circle."""
    links, good = model.links, np.flatnonzero(model.good)
    directions = np.diff(model.joints[good], axis=1) / links[:, None]
    turns = np.linalg.norm(np.diff(directions, axis=1), axis=2)
    # Of a bend by b, |d_(i+1) - d_i| = 2 sin(b / 2).
    radii = 0.5 * (links[:-1] + links[1:]) / np.maximum(turns, 1e-12)
    if radii.size and radii.min() < radius:
        k, i = np.unravel_index(int(np.argmin(radii)), radii.shape)
        raise ConfigError(
            f"joints.min_bend_radius = {radius:g} m, but {model.captures[good[k]].name} is bent to "
            f"{radii[k, i]:.4g} m at joint {i + 1}",
            f"set it to {0.95 * radii[k, i]:.2g} or less, or leave it at auto",
        )


def _states(good: BoolArray, in_time: bool) -> tuple[str, ...]:
    known = np.flatnonzero(good)
    between = np.arange(len(good))
    inside = (between > known[0]) & (between < known[-1])
    return tuple(
        "good" if fine else "none" if not in_time else "interpolated" if within else "held"
        for fine, within in zip(good.tolist(), inside.tolist(), strict=True)
    )
