"""The sections of the configuration: one for each stage, and for what the models need.

A key is declared here, in one place: its type, its default, what it may hold, its help, and the names under which
people look for it.
"""

# The functions that declare settings return fields, which are made for each class.
# ruff: noqa: RUF009

from __future__ import annotations

from dataclasses import dataclass

from dlogen.config.base import Section
from dlogen.config.defaults import (
    CHAIN_FRAME,
    GENERIC_DAMPING_RATIO,
    GENERIC_DENSITY,
    GENERIC_MATERIAL,
    MDTW_SAMPLES,
    MIN_LAST,
    N_PER_TAU,
    PLACEMENT,
    ROOT_LINK,
)
from dlogen.config.fields import AUTO, Auto, choice, flag, integer, length, number, text
from dlogen.config.presets import NO_PRESET, PRESETS

#: What ROS and the model formats accept, without the names of the model's own links and joints.
_FRAME_NAME = r"(?!(segment|joint)_|(base_joint|tip|tip_joint)$)[A-Za-z_][A-Za-z0-9_./-]*"


@dataclass(frozen=True, repr=False, eq=False)
class Normals(Section):
    """Surface normals (paper III.B)."""

    neighbours: int | Auto = integer(
        AUTO,
        "How many nearest points the plane of a normal is fitted to.",
        auto="chosen from the cloud, unless `radius` is set",
        least=3,
        most=1000,
        sought=("neighbors", "k", "knn", "k_neighbours", "n_neighbours"),
    )
    radius: float | Auto = length(
        AUTO,
        "Fit the plane of a normal to all points within this distance instead.",
        auto="not used: the nearest `neighbours` are",
        sought=("normal_radius",),
    )
    orientation: str = choice(
        AUTO,
        "Which side of a normal is outward: away from the axis, towards the viewpoint, or as stored in the file.",
        auto="decided from the cloud and from what its file has",
        choices=(AUTO, "outward", "viewpoint", "stored"),
    )


@dataclass(frozen=True, repr=False, eq=False)
class Projection(Section):
    """Projection of the surface points onto the axis (paper Eq. 4)."""

    enabled: bool = flag(True, "Move points inwards by r along their normals; false for objects too thin to matter.")


@dataclass(frozen=True, repr=False, eq=False)
class Sorting(Section):
    """Sorting of the points along the object (paper Eq. 5-6)."""

    start: int | Auto = integer(
        AUTO,
        "Index of the point that the walk starts from, counted from 0.",
        auto="chosen from the cloud",
        least=0,
        sought=("start_point", "p0"),
    )


@dataclass(frozen=True, repr=False, eq=False)
class SkeletonLine(Section):
    """The skeleton line as weighted basis functions (paper Eq. 7-11)."""

    tau: float | Auto = number(
        AUTO,
        "Width parameter of the inverse quadratic basis functions (profile paper).",
        auto=f"N / {N_PER_TAU}, as in the paper, where it is printed as k",
        above=0,
        sought=("width", "basis_width"),
    )


@dataclass(frozen=True, repr=False, eq=False)
class Segmentation(Section):
    """How long the segments are and where the joints (paper III.D, III.E)."""

    criterion: str = choice(
        AUTO,
        "paper: the length of Eq. 17; fewest: the fewest segments whose measured deviation is within e_max.",
        auto="paper in the profile paper, else fewest",
        choices=(AUTO, "paper", "fewest"),
    )
    placement: str = choice(
        PLACEMENT,
        "on-curve: joints on the skeleton line (Eq. 18); minimax: beside it, for about a quarter fewer segments.",
        choices=("on-curve", "minimax"),
        sought=("joint_placement", "off_curve"),
    )
    segments: int | Auto = integer(
        AUTO,
        "Cut into exactly so many equal segments, whatever the deviation.",
        auto="not used: e_max decides",
        least=1,
        most=10_000,
        sought=("n", "segment_count", "number_of_segments", "num_segments"),
    )
    segment_length: float | Auto = length(
        AUTO,
        "Length of every segment but the last, whatever the deviation.",
        auto="not used: e_max decides",
        sought=("l", "l_max", "segment_size"),
    )
    curvature_max: float | Auto = number(
        AUTO,
        "Largest curvature that the object can have, for Eq. 17 in place of the scan's.",
        unit="1/m",
        auto="not used",
        above=0,
        sought=("max_curvature", "kappa", "kappa_max", "curvature"),
    )
    min_bend_radius: float | Auto = length(
        AUTO,
        "Smallest radius that the object can be bent to, for Eq. 17 in place of the scan's.",
        auto="not used",
        sought=("bend_radius", "r_kappa", "radius_of_curvature"),
    )
    min_last: float = number(
        MIN_LAST,
        "Length of the last segment that fewest tries to keep, as a share of the others; 0 for the longest others.",
        least=0,
        most=1,
        sought=("last_segment", "shortest_last"),
    )


@dataclass(frozen=True, repr=False, eq=False)
class MdtwSettings(Section):
    """The error between skeleton line and chain (paper IV.A)."""

    samples: int = integer(
        MDTW_SAMPLES, "Points that each curve is sampled with.", least=2, most=20_000, sought=("num_samples",)
    )


@dataclass(frozen=True, repr=False, eq=False)
class JointSettings(Section):
    """The joints of the models (URDF, SRDF, MJCF, SDF): how they move and what their zero is."""

    dof: int = integer(
        2,
        "Degrees of freedom of each joint: 2 bends (universal joint), 3 bends and twists (ball joint).",
        least=2,
        most=3,
        sought=("degrees_of_freedom", "joint_type"),
    )
    base: str = choice(
        "fixed",
        "Whether the first segment is held where the scan has it, or moves freely.",
        choices=("fixed", "floating"),
        sought=("root", "floating_base", "fixed_base"),
    )
    zero: str = choice(
        "scan",
        "Pose at joint values of zero: as scanned, or straight along the first segment.",
        choices=("scan", "straight"),
        sought=("zero_pose", "reference"),
    )
    rest: str = choice(
        "straight",
        "Shape without load, where the springs of the joints are relaxed. Needs a known Young's modulus.",
        choices=("straight", "scan"),
        sought=("rest_shape", "springref"),
    )
    min_bend_radius: float | Auto = length(
        AUTO,
        "Smallest radius that the axis can be bent to, for the limits of the joints.",
        auto="not known: the joints turn by up to pi",
        sought=("minimum_bending_radius", "bend_radius", "limits"),
    )


@dataclass(frozen=True, repr=False, eq=False)
class Material(Section):
    """What the object is made of, for masses, inertias, stiffness and damping of the models."""

    preset: str = choice(
        NO_PRESET,
        "A known material (dlogen.config.presets). It fills in what the other keys leave at auto.",
        choices=(NO_PRESET, *PRESETS),
        sought=("kind", "type"),
    )
    name: str = text(
        AUTO,
        "Name of the material in the model.",
        auto=f"that of the preset, or {GENERIC_MATERIAL}",
        least=1,
        most=100,
    )
    density: float | Auto = number(
        AUTO,
        "Mass per volume of the cross-section, without the bore of a hollow one.",
        unit="kg/m^3",
        auto=f"from mass, mass_per_length or the preset, else {GENERIC_DENSITY:g}",
        above=0,
        sought=("mass_density", "rho"),
    )
    mass: float | Auto = number(
        AUTO,
        "Mass of the whole object, instead of density.",
        unit="kg",
        auto="follows from density",
        above=0,
        sought=("weight", "total_mass"),
    )
    mass_per_length: float | Auto = number(
        AUTO,
        "Mass per length, instead of density.",
        unit="kg/m",
        auto="follows from density",
        above=0,
        sought=("linear_density", "weight_per_length"),
    )
    inner_radius: float | Auto = number(
        AUTO,
        "Radius of the bore of a hollow object; 0 for a solid one.",
        unit="m",
        auto="from wall_thickness or the preset, else solid",
        least=0,
        sought=("bore", "hollow", "section"),
    )
    wall_thickness: float | Auto = length(
        AUTO,
        "Thickness of the wall of a hollow object, instead of inner_radius.",
        auto="follows from inner_radius",
        sought=("wall",),
    )
    youngs_modulus: float | Auto = number(
        AUTO,
        "Young's modulus E: the one that makes E I the bending stiffness of the object.",
        unit="Pa",
        auto="from shear_modulus and poissons_ratio or the preset, else the joints have no springs",
        above=0,
        sought=("E", "elasticity", "stiffness", "young"),
    )
    shear_modulus: float | Auto = number(
        AUTO,
        "Shear modulus G: the one that makes G J the torsional stiffness of the object.",
        unit="Pa",
        auto="E / (2 (1 + poissons_ratio))",
        above=0,
        sought=("G", "twist_modulus"),
    )
    poissons_ratio: float | Auto = number(
        AUTO,
        "Poisson's ratio, instead of shear_modulus.",
        auto="not used",
        above=-1,
        most=0.5,
        sought=("poisson", "nu", "poisson_ratio"),
    )
    damping_ratio: float | Auto = number(
        AUTO,
        "Damping of the slowest bending vibration when one end is clamped, as a fraction of critical damping.",
        auto=f"that of the preset, else {GENERIC_DAMPING_RATIO:g}; a little damping for limp joints",
        least=0,
        most=10,
        sought=("damping", "zeta"),
    )


@dataclass(frozen=True, repr=False, eq=False)
class FrameSettings(Section):
    """The frame of all output: that of the cloud, moved by use_viewpoint, then convention, then x to yaw."""

    name: str = text(
        AUTO,
        "Name of the frame and of the models' root link: a letter first, then letters, digits and _ . / -, and "
        "none of the models' own names (segment_, joint_, tip).",
        auto=f"{CHAIN_FRAME} in the chain, {ROOT_LINK} in the models",
        least=1,
        most=100,
        pattern=_FRAME_NAME,
        sought=("frame_id", "root_link", "base_link", "root_name"),
    )
    use_viewpoint: bool = flag(
        False,
        "Move the points by the sensor pose that the file stores (VIEWPOINT of PCD, camera of PLY): for points in "
        "the sensor's frame. Else that pose only helps with normals.",
        sought=("viewpoint", "sensor_pose"),
    )
    convention: str = choice(
        "none",
        "optical-to-ros turns from a camera's optical frame (z forward, x right, y down) to that of its body "
        "(x forward, y left, z up), as in REP 103.",
        choices=("none", "optical-to-ros"),
        sought=("optical", "rep103", "axes"),
    )
    x: float = number(0.0, "Position of the cloud's frame in the output's.", unit="m", sought=("xyz",))
    y: float = number(0.0, "Position of the cloud's frame in the output's.", unit="m")
    z: float = number(0.0, "Position of the cloud's frame in the output's.", unit="m")
    roll: float = number(
        0.0, "Turn about x, first, as in URDF: Rz(yaw) Ry(pitch) Rx(roll).", unit="rad", sought=("rpy",)
    )
    pitch: float = number(0.0, "Turn about the fixed y axis, second.", unit="rad")
    yaw: float = number(0.0, "Turn about the fixed z axis, third.", unit="rad")


@dataclass(frozen=True, repr=False, eq=False)
class Report(Section):
    """The report file."""

    timings: bool = flag(True, "Write the seconds that each stage took; they differ from run to run.")
    alternatives: bool = flag(
        False, "Work out what every criterion of segmentation would give, also those that take longer."
    )
