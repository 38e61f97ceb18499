"""The configuration: everything that can be set, declared once.

Every key is a field of `Config` or of one of its sections, with a `Setting` that says what it may hold. The checks, the
commented YAML of `dlogen config show` and the JSON Schema of `dlogen config schema` all follow from that.

Lengths (`r`, `r_n`, `e_max`, `normals.radius`) are metres, always: `units` says only what the cloud's numbers are.
"""

# The functions that declare settings return fields, which are made for each class.
# ruff: noqa: RUF009

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any, Literal

from dlogen.config.base import Section
from dlogen.config.defaults import R_PER_E_MAX
from dlogen.config.fields import AUTO, Auto, choice, integer, length, number
from dlogen.config.keys import Keys
from dlogen.config.problems import Problem, refuse, show
from dlogen.config.rules import contradictions
from dlogen.config.sections import (
    FrameSettings,
    JointSettings,
    Material,
    MdtwSettings,
    Normals,
    Projection,
    Report,
    Segmentation,
    SkeletonLine,
    Sorting,
)
from dlogen.config.values import Values, flat, nested, read_mapping, read_value


@dataclass(frozen=True, repr=False, eq=False)
class Config(Section):
    """Everything that can be set. `Config()` is the default and fits most clouds.

    Raises:
        ConfigError: a value is not allowed, or two contradict each other.

    >>> import dlogen
    >>> config = dlogen.Config(r=0.02, e_max=0.005)
    >>> config.profile, config.segmentation.criterion
    ('refined', 'auto')
    >>> config.replace({"joints.dof": 3}).joints.dof
    3
    """

    profile: Literal["refined", "paper"] = choice(
        "refined",
        "refined: as good as can be made; paper: the stages exactly as published.",
        choices=("refined", "paper"),
        sought=("method", "mode"),
    )
    units: Literal["m", "mm", "cm", "auto"] = choice(
        "m",
        "What the numbers in the cloud are. All settings and all output are metres regardless.",
        auto="guessed from the extent of the cloud",
        choices=("m", "mm", "cm", AUTO),
        sought=("unit", "scale"),
    )
    r: float | Auto = length(
        AUTO, "Radius of the object.", auto="estimated from the cloud", sought=("radius", "diameter", "thickness")
    )
    r_n: float | Auto = length(
        AUTO,
        "Search radius of the sorting walk (Eq. 5); at least the diameter 2 r.",
        auto="chosen from r and the spacing of the points",
        sought=("search_radius", "sorting_radius", "neighbour_radius"),
    )
    N: int | Auto = integer(
        AUTO,
        "Number of basis functions of the skeleton line (Eq. 7).",
        auto="chosen from the cloud",
        least=4,
        most=2000,
        sought=("basis_functions", "num_basis", "n_basis"),
    )
    beta: float | Auto = number(
        AUTO,
        "Regularisation of the weights (Eq. 10-11).",
        auto="the one with the smallest variance of the residuals",
        least=0,
        also=("β",),
        sought=("regularization", "regularisation", "lambda", "ridge", "ß"),
    )
    e_max: float | Auto = length(
        AUTO,
        "Largest distance allowed between the skeleton line and the chain (Eq. 17).",
        auto=f"r / {R_PER_E_MAX}, the paper's ratio",
        sought=("max_error", "error", "tolerance", "accuracy"),
    )
    length: float | Auto = length(
        AUTO,
        "Length of the object, where it is known: a fit says by how much it finds another one.",
        auto="not known",
        sought=("known_length", "total_length", "object_length", "L"),
    )
    mesh: Literal["auto", "sample", "vertices"] = choice(
        AUTO,
        "What of a file that is a mesh is used: points spread over its faces, or its vertices.",
        auto="its faces where its vertices do not cover its surface",
        choices=(AUTO, "sample", "vertices"),
        sought=("faces", "triangles"),
    )
    seed: int = integer(0, "Seed of everything random.", least=0, most=2**32 - 1, sought=("random_seed",))
    normals: Normals = field(default_factory=Normals)
    projection: Projection = field(default_factory=Projection)
    sorting: Sorting = field(default_factory=Sorting)
    skeleton: SkeletonLine = field(default_factory=SkeletonLine)
    segmentation: Segmentation = field(default_factory=Segmentation)
    mdtw: MdtwSettings = field(default_factory=MdtwSettings)
    joints: JointSettings = field(default_factory=JointSettings)
    material: Material = field(default_factory=Material)
    frame: FrameSettings = field(default_factory=FrameSettings)
    report: Report = field(default_factory=Report)

    def __post_init__(self) -> None:
        super().__post_init__()
        wrong = [
            Problem("", f"{name} = {show(getattr(self, name))}: expected {kind.__name__}(...)", "see dlogen.config")
            for name, kind in _sections().items()
            if not isinstance(getattr(self, name), kind)
        ]
        refuse(wrong)
        refuse(contradictions(flat(self.to_dict()), {}))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Config:
        """The configuration that a mapping describes, with mappings for sections. What is left out is default.

        Raises:
            ConfigError: names every key that is unknown or holds what it may not.
        """
        values, problems = read_mapping(config_keys(), data)
        refuse(problems)
        return cls._of(values)

    def to_dict(self) -> dict[str, Any]:
        """As nested plain data, in the order of declaration. `from_dict` reads it back."""
        return self.own_values() | {name: getattr(self, name).own_values() for name in _sections()}

    def replace(self, changes: Mapping[str, Any] | None = None, /, **top: Any) -> Config:
        """A configuration that differs in some keys: `config.replace({"normals.neighbours": 20}, e_max=0.005)`.

        Raises:
            ConfigError: as `from_dict`.
        """
        values, problems = flat(self.to_dict()), list[Problem]()
        for name, value in {**(changes or {}), **top}.items():
            key = config_keys().find(name)
            if key is None:
                problems.append(config_keys().unknown("", name))
            else:
                values |= read_value(config_keys(), key, value, "", problems)
        refuse(problems)
        return self._of(values)

    def value(self, key: str) -> Any:
        """The value of a dotted key."""
        section, _, name = key.rpartition(".")
        return getattr(getattr(self, section) if section else self, name)

    def resolved(self, chosen: Mapping[str, Any]) -> Config:
        """The configuration with what a fit chose for `auto`.

        What may be set and the rules between keys are for what users say; they do not hold for what was chosen.

        Args:
            chosen: values by dotted key, of keys that there are.
        """
        out = copy(self)
        for section in {key.rpartition(".")[0] for key in chosen} - {""}:
            object.__setattr__(out, section, copy(getattr(self, section)))
        for key, value in chosen.items():
            section, _, name = key.rpartition(".")
            object.__setattr__(getattr(out, section) if section else out, name, value)
        return out

    @classmethod
    def _of(cls, values: Values) -> Config:
        """From checked values by dotted key."""
        made = nested(values)
        for name in _sections().keys() & made.keys():
            made[name] = _sections()[name](**made[name])
        return cls(**made)


@cache
def config_keys() -> Keys:
    """All keys, with what they may hold."""
    kinds = _sections()
    settings = {**Config.settings()} | flat({section: kind.settings() for section, kind in kinds.items()})
    return Keys(settings, {section: kind.__doc__ or "" for section, kind in kinds.items()})


@cache
def _sections() -> dict[str, type[Section]]:
    """The sections by the names of their fields."""
    factories: dict[str, Any] = {item.name: item.default_factory for item in fields(Config)}
    return {name: kind for name, kind in factories.items() if isinstance(kind, type) and issubclass(kind, Section)}
