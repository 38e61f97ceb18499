"""The configuration: everything that can be set, declared once.

Every key is a field of `Config` or of one of its sections, with a `Setting` that says what it may hold. The checks, the
commented YAML of `dlogen config show` and the JSON Schema of `dlogen config schema` all follow from that.

Lengths (`r`, `r_n`, `e_max`, `normals.radius`) are metres, always: `units` says only what the cloud's numbers are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, cast

from dlogen.config.fields import AUTO, Auto, Keys, Problem, Setting, refuse, show, wrong_value
from dlogen.config.presets import PRESETS
from dlogen.config.reader import Values, read_file, read_mapping, read_override, read_value

#: What ROS and the model formats accept, without the names of the model's own links and joints.
_FRAME_NAME = r"(?!(segment|joint)_|(base_joint|tip|tip_joint)$)[A-Za-z_][A-Za-z0-9_./-]*"


def _holds(*args: Any, **kwargs: Any) -> dict[str, Setting]:
    """A `Setting` as the metadata of a dataclass field."""
    return {"setting": Setting(*args, **kwargs)}


class _Section:
    """Checks its settings when it is made. What a section is about stands in its docstring."""

    @classmethod
    def settings(cls) -> dict[str, Setting]:
        """The settings among the fields, by name, in the order of declaration."""
        own = fields(cast("Any", cls))
        return {item.name: item.metadata["setting"] for item in own if "setting" in item.metadata}

    def __post_init__(self) -> None:
        problems = []
        for name, setting in self.settings().items():
            value = getattr(self, name)
            try:
                object.__setattr__(self, name, setting.read(value))
            except ValueError as error:
                problems.append(wrong_value("", name, value, setting, str(error)))
        refuse(problems)


@dataclass(frozen=True)
class Normals(_Section):
    """Surface normals (paper III.B)."""

    neighbours: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "How many nearest points the plane of a normal is fitted to.",
            auto="chosen from the cloud, unless `radius` is set",
            least=3,
            most=1000,
            sought=("neighbors", "k", "knn", "k_neighbours", "n_neighbours"),
        ),
    )
    radius: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Fit the plane of a normal to all points within this distance instead.",
            unit="m",
            auto="not used: the nearest `neighbours` are",
            above=0,
            sought=("normal_radius",),
        ),
    )
    orientation: str = field(
        default=AUTO,
        metadata=_holds(
            "choice",
            "Which side of a normal is outward: away from the axis, towards the viewpoint, or as stored in the file.",
            auto="decided from the cloud and from what its file has",
            choices=(AUTO, "outward", "viewpoint", "stored"),
        ),
    )


@dataclass(frozen=True)
class Projection(_Section):
    """Projection of the surface points onto the axis (paper Eq. 4)."""

    enabled: bool = field(
        default=True,
        metadata=_holds("flag", "Move points inwards by r along their normals; false for objects too thin to matter."),
    )


@dataclass(frozen=True)
class Sorting(_Section):
    """Sorting of the points along the object (paper Eq. 5-6)."""

    start: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "Index of the point that the walk starts from, counted from 0.",
            auto="chosen from the cloud",
            least=0,
            sought=("start_point", "p0"),
        ),
    )


@dataclass(frozen=True)
class SkeletonLine(_Section):
    """The skeleton line as weighted basis functions (paper Eq. 7-11)."""

    tau: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Width parameter of the inverse quadratic basis functions (profile paper).",
            auto="N / 4, as in the paper, where it is printed as k",
            above=0,
            sought=("width", "basis_width"),
        ),
    )


@dataclass(frozen=True)
class Segmentation(_Section):
    """How long the segments are and where the joints (paper III.D, III.E)."""

    criterion: str = field(
        default=AUTO,
        metadata=_holds(
            "choice",
            "paper: the length of Eq. 17; fewest: the fewest segments whose measured deviation is within e_max.",
            auto="paper in the profile paper, else fewest",
            choices=(AUTO, "paper", "fewest"),
        ),
    )
    placement: str = field(
        default="on-curve",
        metadata=_holds(
            "choice",
            "on-curve: joints on the skeleton line (Eq. 18); minimax: beside it, for about a quarter fewer segments.",
            choices=("on-curve", "minimax"),
            sought=("joint_placement", "off_curve"),
        ),
    )
    segments: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "Cut into exactly so many equal segments, whatever the deviation.",
            auto="not used: e_max decides",
            least=1,
            most=10_000,
            sought=("n", "segment_count", "number_of_segments", "num_segments"),
        ),
    )
    segment_length: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Length of every segment but the last, whatever the deviation.",
            unit="m",
            auto="not used: e_max decides",
            above=0,
            sought=("l", "length", "l_max", "segment_size"),
        ),
    )
    curvature_max: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Largest curvature that the object can have, for Eq. 17 in place of the scan's.",
            unit="1/m",
            auto="not used",
            above=0,
            sought=("max_curvature", "kappa", "kappa_max", "curvature"),
        ),
    )
    min_bend_radius: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Smallest radius that the object can be bent to, for Eq. 17 in place of the scan's.",
            unit="m",
            auto="not used",
            above=0,
            sought=("bend_radius", "r_kappa", "radius_of_curvature"),
        ),
    )
    min_last: float = field(
        default=0.5,
        metadata=_holds(
            "number",
            "Length of the last segment that fewest tries to keep, as a share of the others; 0 for the longest others.",
            least=0,
            most=1,
            sought=("last_segment", "shortest_last"),
        ),
    )


@dataclass(frozen=True)
class MdtwSettings(_Section):
    """The error between skeleton line and chain (paper IV.A)."""

    samples: int = field(
        default=1000,
        metadata=_holds(
            "integer", "Points that each curve is sampled with.", least=2, most=20_000, sought=("num_samples",)
        ),
    )


@dataclass(frozen=True)
class JointSettings(_Section):
    """The joints of the models (URDF, SRDF, MJCF, SDF): how they move and what their zero is."""

    dof: int = field(
        default=2,
        metadata=_holds(
            "integer",
            "Degrees of freedom of each joint: 2 bends (universal joint), 3 bends and twists (ball joint).",
            least=2,
            most=3,
            sought=("degrees_of_freedom", "joint_type"),
        ),
    )
    base: str = field(
        default="fixed",
        metadata=_holds(
            "choice",
            "Whether the first segment is held where the scan has it, or moves freely.",
            choices=("fixed", "floating"),
            sought=("root", "floating_base", "fixed_base"),
        ),
    )
    zero: str = field(
        default="scan",
        metadata=_holds(
            "choice",
            "Pose at joint values of zero: as scanned, or straight along the first segment.",
            choices=("scan", "straight"),
            sought=("zero_pose", "reference"),
        ),
    )
    rest: str = field(
        default="straight",
        metadata=_holds(
            "choice",
            "Shape without load, where the springs of the joints are relaxed. Needs a known Young's modulus.",
            choices=("straight", "scan"),
            sought=("rest_shape", "springref"),
        ),
    )
    min_bend_radius: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Smallest radius that the axis can be bent to, for the limits of the joints.",
            unit="m",
            auto="not known: the joints turn by up to pi",
            above=0,
            sought=("minimum_bending_radius", "bend_radius", "limits"),
        ),
    )


@dataclass(frozen=True)
class Material(_Section):
    """What the object is made of, for masses, inertias, stiffness and damping of the models."""

    preset: str = field(
        default="none",
        metadata=_holds(
            "choice",
            "A known material (dlogen.multibody.materials). It fills in what the other keys leave at auto.",
            choices=("none", *PRESETS),
            sought=("kind", "type"),
        ),
    )
    name: str = field(
        default=AUTO,
        metadata=_holds(
            "text", "Name of the material in the model.", auto="that of the preset, or generic", least=1, most=100
        ),
    )
    density: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Mass per volume of the cross-section, without the bore of a hollow one.",
            unit="kg/m^3",
            auto="from mass, mass_per_length or the preset, else 1200",
            above=0,
            sought=("mass_density", "rho"),
        ),
    )
    mass: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Mass of the whole object, instead of density.",
            unit="kg",
            auto="follows from density",
            above=0,
            sought=("weight", "total_mass"),
        ),
    )
    mass_per_length: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Mass per length, instead of density.",
            unit="kg/m",
            auto="follows from density",
            above=0,
            sought=("linear_density", "weight_per_length"),
        ),
    )
    inner_radius: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Radius of the bore of a hollow object; 0 for a solid one.",
            unit="m",
            auto="from wall_thickness or the preset, else solid",
            least=0,
            sought=("bore", "hollow", "section"),
        ),
    )
    wall_thickness: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Thickness of the wall of a hollow object, instead of inner_radius.",
            unit="m",
            auto="follows from inner_radius",
            above=0,
            sought=("wall",),
        ),
    )
    youngs_modulus: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Young's modulus E: the one that makes E I the bending stiffness of the object.",
            unit="Pa",
            auto="from shear_modulus and poissons_ratio or the preset, else the joints have no springs",
            above=0,
            sought=("E", "elasticity", "stiffness", "young"),
        ),
    )
    shear_modulus: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Shear modulus G: the one that makes G J the torsional stiffness of the object.",
            unit="Pa",
            auto="E / (2 (1 + poissons_ratio))",
            above=0,
            sought=("G", "twist_modulus"),
        ),
    )
    poissons_ratio: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Poisson's ratio, instead of shear_modulus.",
            auto="not used",
            above=-1,
            most=0.5,
            sought=("poisson", "nu", "poisson_ratio"),
        ),
    )
    damping_ratio: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Damping of the slowest bending vibration when one end is clamped, as a fraction of critical damping.",
            auto="that of the preset, else 0.05; a little damping for limp joints",
            least=0,
            most=10,
            sought=("damping", "zeta"),
        ),
    )


def _coordinate(what: str, unit: str, sought: tuple[str, ...]) -> dict[str, Setting]:
    return _holds("number", what, unit=unit, sought=sought)


@dataclass(frozen=True)
class FrameSettings(_Section):
    """The frame of all output: that of the cloud, moved by use_viewpoint, then convention, then x to yaw."""

    name: str = field(
        default=AUTO,
        metadata=_holds(
            "text",
            "Name of the frame and of the models' root link: a letter first, then letters, digits and _ . / -, and "
            "none of the models' own names (segment_, joint_, tip).",
            auto="cloud in the chain, base_link in the models",
            least=1,
            most=100,
            pattern=_FRAME_NAME,
            sought=("frame_id", "root_link", "base_link", "root_name"),
        ),
    )
    use_viewpoint: bool = field(
        default=False,
        metadata=_holds(
            "flag",
            "Move the points by the sensor pose that the file stores (VIEWPOINT of PCD, camera of PLY): for points in "
            "the sensor's frame. Else that pose only helps with normals.",
            sought=("viewpoint", "sensor_pose"),
        ),
    )
    convention: str = field(
        default="none",
        metadata=_holds(
            "choice",
            "optical-to-ros turns from a camera's optical frame (z forward, x right, y down) to that of its body "
            "(x forward, y left, z up), as in REP 103.",
            choices=("none", "optical-to-ros"),
            sought=("optical", "rep103", "axes"),
        ),
    )
    x: float = field(default=0.0, metadata=_coordinate("Position of the cloud's frame in the output's.", "m", ("xyz",)))
    y: float = field(default=0.0, metadata=_coordinate("Position of the cloud's frame in the output's.", "m", ()))
    z: float = field(default=0.0, metadata=_coordinate("Position of the cloud's frame in the output's.", "m", ()))
    roll: float = field(
        default=0.0,
        metadata=_coordinate("Turn about x, first, as in URDF: Rz(yaw) Ry(pitch) Rx(roll).", "rad", ("rpy",)),
    )
    pitch: float = field(default=0.0, metadata=_coordinate("Turn about the fixed y axis, second.", "rad", ()))
    yaw: float = field(default=0.0, metadata=_coordinate("Turn about the fixed z axis, third.", "rad", ()))


@dataclass(frozen=True)
class Report(_Section):
    """The report file."""

    timings: bool = field(
        default=True,
        metadata=_holds("flag", "Write the seconds that each stage took; they differ from run to run."),
    )
    alternatives: bool = field(
        default=False,
        metadata=_holds(
            "flag", "Work out what every criterion of segmentation would give, also those that take longer."
        ),
    )


@dataclass(frozen=True)
class Config(_Section):
    """Everything that can be set. `Config()` is the default and fits most clouds.

    Raises:
        ConfigError: a value is not allowed, or two contradict each other.
    """

    profile: Literal["refined", "paper"] = field(
        default="refined",
        metadata=_holds(
            "choice",
            "refined: as good as can be made; paper: the stages exactly as published.",
            choices=("refined", "paper"),
            sought=("method", "mode"),
        ),
    )
    units: Literal["m", "mm", "cm", "auto"] = field(
        default="m",
        metadata=_holds(
            "choice",
            "What the numbers in the cloud are. All settings and all output are metres regardless.",
            auto="guessed from the extent of the cloud",
            choices=("m", "mm", "cm", AUTO),
            sought=("unit", "scale"),
        ),
    )
    r: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Radius of the object.",
            unit="m",
            auto="estimated from the cloud",
            above=0,
            sought=("radius", "diameter", "thickness"),
        ),
    )
    r_n: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Search radius of the sorting walk (Eq. 5); at least the diameter 2 r.",
            unit="m",
            auto="chosen from r and the spacing of the points",
            above=0,
            sought=("search_radius", "sorting_radius", "neighbour_radius"),
        ),
    )
    N: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "Number of basis functions of the skeleton line (Eq. 7).",
            auto="chosen from the cloud",
            least=4,
            most=2000,
            sought=("basis_functions", "num_basis", "n_basis"),
        ),
    )
    beta: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Regularisation of the weights (Eq. 10-11).",
            auto="the one with the smallest variance of the residuals",
            least=0,
            also=("β",),
            sought=("regularization", "regularisation", "lambda", "ridge", "ß"),
        ),
    )
    e_max: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Largest distance allowed between the skeleton line and the chain (Eq. 17).",
            unit="m",
            auto="r / 2, the paper's ratio",
            above=0,
            sought=("max_error", "error", "tolerance", "accuracy"),
        ),
    )
    seed: int = field(
        default=0,
        metadata=_holds("integer", "Seed of everything random.", least=0, most=2**32 - 1, sought=("random_seed",)),
    )
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
        refuse(_contradictions(self._values(), {}))

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
        out: dict[str, Any] = {}
        for key, value in self._values().items():
            section, _, name = key.rpartition(".")
            (out.setdefault(section, {}) if section else out)[name] = value
        return out

    def replace(self, changes: Mapping[str, Any] | None = None, /, **top: Any) -> Config:
        """A configuration that differs in some keys: `config.replace({"normals.neighbours": 20}, e_max=0.005)`.

        Raises:
            ConfigError: as `from_dict`.
        """
        values, problems = self._values(), list[Problem]()
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

        The rules between keys are for what users say; they do not hold for what was chosen.

        Args:
            chosen: values by dotted key, of keys that there are.
        """
        of_section: dict[str, dict[str, Any]] = {}
        out = copy(self)
        for key, value in chosen.items():
            section, _, name = key.rpartition(".")
            if section:
                of_section.setdefault(section, {})[name] = value
            else:
                object.__setattr__(out, name, value)
        for section, values in of_section.items():
            object.__setattr__(out, section, replace(getattr(self, section), **values))
        return out

    def _values(self) -> Values:
        """All values by dotted key."""
        values: Values = {name: getattr(self, name) for name in self.settings()}
        for section, kind in _sections().items():
            values |= {f"{section}.{name}": getattr(getattr(self, section), name) for name in kind.settings()}
        return values

    @classmethod
    def _of(cls, values: Values) -> Config:
        """From checked values by dotted key; the opposite of `_values`."""
        nested: dict[str, dict[str, Any]] = {"": {}}
        for key, value in values.items():
            section, _, name = key.rpartition(".")
            nested.setdefault(section, {})[name] = value
        top: dict[str, Any] = nested.pop("")
        return cls(**top, **{section: cast("Any", _sections()[section](**inner)) for section, inner in nested.items()})


def load_config(
    path: str | Path | None = None,
    overrides: Sequence[str] = (),
    *,
    base: Config | None = None,
    text: str | None = None,
) -> Config:
    """Read a YAML file and apply overrides to it.

    Args:
        path: the file; "-" for standard input; None for the defaults.
        overrides: "KEY=VALUE" with dotted keys, such as "normals.neighbours=20". Later ones win over earlier ones, and
            all of them over the file.
        base: what the file and the overrides change; the defaults if left out.
        text: what the file holds, where that is known already; it is not opened then.

    Raises:
        ConfigError: the file cannot be read or is not YAML; a key is unknown, given twice or holds what it may not;
            two keys contradict each other. All that is wrong is named, with lines.
    """
    values: Values = {} if base is None else base._values()
    places: dict[str, str] = {}
    if path is not None:
        read, places = read_file(config_keys(), path, text)
        values |= read
    problems: list[Problem] = []
    for override in overrides:
        value, place = read_override(config_keys(), override, problems)
        values |= value
        places |= place
    refuse(problems)
    refuse(_contradictions(values, places))
    return Config._of(values)


@cache
def config_keys() -> Keys:
    """All keys, with what they may hold."""
    settings = Config.settings()
    for section, kind in _sections().items():
        settings |= {f"{section}.{name}": setting for name, setting in kind.settings().items()}
    return Keys(settings, {section: kind.__doc__ or "" for section, kind in _sections().items()})


@cache
def _sections() -> dict[str, type[_Section]]:
    factories: dict[str, Any] = {item.name: item.default_factory for item in fields(Config)}
    return {name: kind for name, kind in factories.items() if isinstance(kind, type) and issubclass(kind, _Section)}


def _contradictions(values: Values, places: Mapping[str, str]) -> list[Problem]:
    """What is wrong between keys that are each right, as far as it shows without a cloud."""

    def said(key: str) -> str:
        return f"{key} = {values[key]}" + (f" ({places[key]})" if key in places else "")

    given = {key: value for key, value in values.items() if value != AUTO}
    problems = []
    if "r" in given and "r_n" in given and given["r_n"] < 2 * given["r"]:
        problems.append(
            Problem(
                "",
                f"{said('r_n')} is less than the diameter 2 r = {2 * given['r']:.12g}, with {said('r')}",
                "the sorting walk needs r_n > 2 r (paper III.B; its experiment has 8 r), or leave r_n at auto",
            )
        )
    if "normals.neighbours" in given and "normals.radius" in given:
        problems.append(
            Problem(
                "",
                f"{said('normals.neighbours')} and {said('normals.radius')} contradict each other",
                "set one of them: a plane is fitted either to the nearest points or to all within a radius",
            )
        )
    problems += _material_contradictions(given, said)
    problems += _segmentation_contradictions(given, said)
    # Nobody has a cable a metre thick: the number was meant in the cloud's units.
    factor = {"mm": 1e-3, "cm": 1e-2}.get(given.get("units", ""))
    for key in ("r", "e_max"):
        if factor and given.get(key, 0) >= 1:
            problems.append(
                Problem(
                    "",
                    f"{said(key)} is a metre or more, with {said('units')}",
                    "lengths in the configuration are metres, whatever the cloud is in: "
                    f"{given[key]:g} {given['units']} is {given[key] * factor:.12g}",
                )
            )
    return problems


_MODULI = ("youngs_modulus", "shear_modulus", "poissons_ratio")


def _segmentation_contradictions(given: Values, said: Callable[[str], str]) -> list[Problem]:
    """What is wrong between the keys of the segmentation: each of them alone says how long the segments are."""
    known = [
        key
        for name in ("segments", "segment_length", "curvature_max", "min_bend_radius")
        if (key := f"segmentation.{name}") in given
    ]
    problems = []
    if len(known) > 1:
        problems.append(
            Problem(
                "",
                f"{' and '.join(map(said, known))} contradict each other",
                "set one of them: each says how long the segments are",
            )
        )
    criterion, placement = given.get("segmentation.criterion"), given.get("segmentation.placement")
    rules = [key for key in known if key.endswith(("segments", "segment_length"))]
    if criterion is not None and (criterion == "fewest" or rules) and known:
        problems.append(
            Problem(
                "",
                f"{said('segmentation.criterion')} and {said(known[0])} contradict each other",
                "leave criterion at auto where the segments are given",
            )
        )
    if placement == "minimax" and (known or criterion == "paper"):
        other = known[0] if known else "segmentation.criterion"
        problems.append(
            Problem(
                "",
                f"{said('segmentation.placement')} and {said(other)} contradict each other",
                "minimax looks for the fewest segments: set criterion to fewest and leave the others at auto",
            )
        )
    elif placement == "minimax" and criterion is None and given.get("profile") == "paper":
        problems.append(
            Problem(
                "",
                f"{said('segmentation.placement')}, but the profile paper has its joints on the line (Eq. 18)",
                "set segmentation.criterion to fewest as well",
            )
        )
    return problems


def _material_contradictions(given: Values, said: Callable[[str], str]) -> list[Problem]:
    """What is wrong between the keys of the material. A preset is only a default: it contradicts nothing."""
    problems = []
    for most, names, hint in (
        (1, ("density", "mass", "mass_per_length"), "set one of them: the others follow from it"),
        (1, ("inner_radius", "wall_thickness"), "set one of them: inner_radius + wall_thickness = r"),
        (2, _MODULI, "set two of them: G = E / (2 (1 + nu))"),
    ):
        keys = [key for name in names if (key := f"material.{name}") in given]
        if len(keys) > most:
            problems.append(Problem("", f"{' and '.join(map(said, keys))} contradict each other", hint))
    for name in ("inner_radius", "wall_thickness"):
        key = f"material.{name}"
        if "r" in given and given.get(key, 0) >= given["r"]:
            problems.append(Problem("", f"{said(key)} is not less than {said('r')}", "r is the outer radius"))
    if given.get("material.preset", "none") != "none":
        return problems  # it knows all moduli
    young, shear, ratio = (f"material.{name}" in given for name in _MODULI)
    if shear and not (young or ratio):
        problems.append(
            Problem(
                "",
                f"{said('material.shear_modulus')} says nothing of the bending stiffness",
                "set material.youngs_modulus or material.poissons_ratio as well",
            )
        )
    if young and not (shear or ratio) and given.get("joints.dof") == 3:
        problems.append(
            Problem(
                "",
                f"{said('joints.dof')}: {said('material.youngs_modulus')} says nothing of the torsional stiffness",
                "set material.poissons_ratio or material.shear_modulus as well, or joints.dof to 2",
            )
        )
    if not (young or shear):
        for key in ("material.poissons_ratio", "material.damping_ratio"):
            if key in given:
                problems.append(
                    Problem("", f"{said(key)}, but no modulus is known", "set material.youngs_modulus or a preset")
                )
    return problems
