"""Reading a chain again that `dlogen fit` has written (`NAME.json`, schema dlogen.chain/1)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dlogen.config.defaults import ROOT_LINK
from dlogen.config.fields import AUTO
from dlogen.config.schema import Config
from dlogen.errors import ConfigError, InputError
from dlogen.geometry.basis import InverseQuadratic, basis_from_dict
from dlogen.io.report import CHAIN_SCHEMA
from dlogen.multibody.build import build_model
from dlogen.multibody.model import MultibodyModel
from dlogen.types import Array, Basis, Chain, Finding, Frame, Quality, Skeleton
from dlogen.types.short_repr import ShortRepr

#: Sections of the configuration that the multibody model is made with. A fit chooses nothing in them.
_OF_MODEL = ("joints", "material", "frame")

#: A chain of 100,000 segments is as large; larger files are something else.
_MOST_BYTES = 1 << 30


@dataclass(frozen=True, eq=False, repr=False)
class LoadedChain(ShortRepr):
    """A kinematic chain that was read from a file, as it was when it was written.

    Attributes:
        name: of the file, without its ending.
        profile: "refined" or "paper".
        skeleton: the skeleton line f(s).
        skeleton_points: (1000, 3) the same, even in arc length, metres.
        chain: joints (n + 1, 3), lengths (n,), transforms (n, 4, 4), radius; metres.
        frame: the frame that all of this is in.
        e_max, max_deviation: allowed and measured distance between skeleton line and chain, metres.
        quality: verdict and findings.
        config: the resolved configuration that it was made with.
        provenance: version, input, its hash and size.

    >>> import dlogen, tempfile
    >>> result = dlogen.fit(dlogen.synth("bent", points=2000, seed=1).points, {"e_max": 0.05})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     chain = dlogen.load_chain(result.write(folder, ["json"])[0])
    >>> chain.skeleton(0.5).shape, chain.joints.shape, chain.joint_values.shape, chain.transforms.shape
    ((3,), (11, 3), (9, 2), (10, 4, 4))
    """

    name: str
    profile: str
    skeleton: Skeleton
    skeleton_points: Array
    chain: Chain
    frame: Frame
    e_max: float
    max_deviation: float
    quality: Quality
    config: Config
    provenance: dict[str, Any]

    @property
    def joints(self) -> Array:
        """(n + 1, 3) the paper's x_0 .. x_n, metres."""
        return self.chain.joints

    @property
    def transforms(self) -> Array:
        """(n, 4, 4) pose of each segment, frame in its centre, x axis along it (Eq. 1-2)."""
        return self.chain.transforms

    @cached_property
    def model(self) -> MultibodyModel:
        """The multibody model: joint values of the scanned and the straight pose, limits, forward kinematics."""
        return build_model(
            self.chain,
            self.config.joints,
            self.config.material,
            name=self.name,
            root=ROOT_LINK if self.config.frame.name == AUTO else self.frame.name,
        )

    @property
    def joint_values(self) -> Array:
        """(n - 1, dof) values of the joints in the scanned pose, radians."""
        return self.model.scanned


def load_chain(path: str | Path) -> LoadedChain:
    """Read a chain that `dlogen fit` or `Result.write` has written.

    Args:
        path: NAME.json, schema dlogen.chain/1.

    Returns:
        The chain: evaluate f(s), joints, joint values, transforms; metres, radians.

    Raises:
        InputError: there is no such file, it is not a chain, or something in it is missing or damaged.

    >>> import dlogen, tempfile
    >>> result = dlogen.fit(dlogen.synth("straight", points=2000, seed=1).points)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path, _ = result.write(folder, ["json"])
    ...     chain = dlogen.load_chain(path)
    >>> bool((chain.joints == result.chain.joints).all())
    True
    """
    data = _read(Path(path))
    try:
        return _chain(Path(path).name.removesuffix(".json"), data)
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError, ConfigError) as error:
        raise InputError(
            f"the chain is incomplete or damaged: {type(error).__name__}: {error}",
            "write it again: dlogen fit",
            path=path,
        ) from error


def _read(path: Path) -> Mapping[str, Any]:
    try:
        if path.is_file() and path.stat().st_size > _MOST_BYTES:
            raise InputError("the file is too large for a chain", "give NAME.json, as dlogen fit writes it", path=path)
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror or error}", "check the path", path=path) from error
    except (ValueError, RecursionError) as error:
        hint = "give NAME.json, as dlogen fit writes it"
        raise InputError(f"this is not valid JSON: {error}", hint, path=path) from None
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema != CHAIN_SCHEMA:
        hint = "give NAME.json, not NAME.report.json" if schema == "dlogen.report/1" else "dlogen fit writes chains"
        raise InputError(f"this is not a chain: its schema is {schema!r}, not {CHAIN_SCHEMA!r}", hint, path=path)
    chain: Mapping[str, Any] = data
    return chain


def _chain(name: str, data: Mapping[str, Any]) -> LoadedChain:
    line, links = data["skeleton"], data["links"]
    basis = _basis(line["basis"])
    skeleton = Skeleton(
        basis,
        _array(line["basis"]["weights"], (basis.size, 3)),
        _array(line["basis"]["offset"], (3,)),
        _number(line["length"]),
    )
    joints = _array(data["joints"], (len(links) + 1, 3))
    chain = Chain(
        joints,
        _array(data["joint_s"], (len(joints),)),
        _array([link["transform"] for link in links], (len(links), 4, 4)),
        _array([link["length"] for link in links], (len(links),)),
        _number(data["radius"]),
    )
    return LoadedChain(
        name=name,
        profile=data["profile"],
        skeleton=skeleton,
        skeleton_points=_array(line["points"], (-1, 3)),
        chain=chain,
        frame=Frame(data["frame"], _array(data["frame_transform"], (4, 4))),
        e_max=_number(data["e_max"]),
        max_deviation=_number(data["max_deviation"]),
        quality=Quality(tuple(Finding.from_dict(item) for item in data["quality"]["findings"])),
        config=_config(data["provenance"]["config"]),
        provenance=dict(data["provenance"]),
    )


def _basis(data: dict[str, Any]) -> Basis:
    basis = basis_from_dict(data)
    if isinstance(basis, InverseQuadratic):
        _number(basis.tau)
    return basis


def _config(data: Mapping[str, Any]) -> Config:
    """What the chain was made with. What a fit chose need not be what may be set; what the model is made of must."""
    Config.from_dict({name: data[name] for name in _OF_MODEL if name in data})
    return Config().resolved(_flat(data))


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("numbers that are not finite")
    return number


def _array(value: Any, shape: tuple[int, ...]) -> Array:
    """Numbers of that shape; -1 stands for any length."""
    array = np.asarray(value, dtype=float)
    if array.ndim != len(shape) or any(want not in (-1, have) for want, have in zip(shape, array.shape, strict=True)):
        raise ValueError(f"an array of the shape {array.shape} where {shape} is due")
    if not np.isfinite(array).all():
        raise ValueError("numbers that are not finite")
    return array


def _flat(nested: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted key."""
    flat: dict[str, Any] = {}
    for key, value in nested.items():
        flat |= (
            {f"{key}.{name}": inner for name, inner in value.items()} if isinstance(value, Mapping) else {key: value}
        )
    return flat
