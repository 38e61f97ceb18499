"""What objects are made of: known materials, and the mechanical properties of a cross-section.

The moduli are those of a homogeneous section of the same size, so that E I and G J are the stiffness of the object as
a whole (Timoshenko & Gere, Mechanics of Materials). They are not those of the stuff that a cable is made of: strands
slide on one another and corrugations unfold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dlogen.config.defaults import GENERIC_DAMPING_RATIO, GENERIC_DENSITY, GENERIC_MATERIAL
from dlogen.config.fields import AUTO
from dlogen.config.presets import PRESETS, Preset
from dlogen.errors import ConfigError

if TYPE_CHECKING:
    from dlogen.config.sections import Material

#: 1.875^2, from the first root of cos(x) cosh(x) = -1: the slowest bending vibration of a cantilever is at
#: 3.516 sqrt(E I / (m' L^4)) radians a second (Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1).
_CANTILEVER = 3.5160152685

#: Damping of a limp object; see `Properties.bending_damping`.
_LIMP = 0.005
_GRAVITY = 9.80665


@dataclass(frozen=True)
class Properties:
    """Mechanical properties of an object of constant circular or annular cross-section.

    Attributes:
        name: of the material.
        radius, inner_radius: metres; inner_radius is 0 for a solid section.
        length: of the whole object, metres.
        mass_per_length: kg/m.
        youngs_modulus, shear_modulus: Pa; None where not known.
        damping_ratio: of the slowest bending vibration as a cantilever; None where no modulus is known.
    """

    name: str
    radius: float
    inner_radius: float
    length: float
    mass_per_length: float
    youngs_modulus: float | None
    shear_modulus: float | None
    damping_ratio: float | None

    @property
    def mass(self) -> float:
        """Of the whole object, kg."""
        return self.mass_per_length * self.length

    @property
    def area(self) -> float:
        """Of the cross-section, m^2."""
        return math.pi * (self.radius**2 - self.inner_radius**2)

    @property
    def second_moment(self) -> float:
        """I = pi (r^4 - r_i^4) / 4, m^4. The polar moment J of a circular section is twice that."""
        return 0.25 * math.pi * (self.radius**4 - self.inner_radius**4)

    @property
    def bending_stiffness(self) -> float | None:
        """E I, N m^2."""
        return None if self.youngs_modulus is None else self.youngs_modulus * self.second_moment

    @property
    def torsional_stiffness(self) -> float | None:
        """G J, N m^2."""
        return None if self.shear_modulus is None else self.shear_modulus * 2.0 * self.second_moment

    @property
    def bending_damping(self) -> float:
        """Moment per rate of curvature, N m^2 s. Of a joint it is divided by the length that the joint stands for.

        Where E I is known, beta E I with beta = 2 zeta / omega (stiffness-proportional damping). Kelvin-Voigt damping
        gives a mode of frequency omega the damping ratio beta omega / 2 (Clough & Penzien, Dynamics of Structures,
        section 12-5), here the wanted one for the slowest bending vibration of a straight cantilever. Faster modes are
        damped more, as those of real cables are, and all simulators get the same numbers.

        Where it is not known, 0.005 m' L^2 sqrt(g L): an assumption of the size that the presets have. Without any,
        a chain of limp joints gains energy in integrators of fixed step.
        """
        stiffness = self.bending_stiffness
        if stiffness is None or self.damping_ratio is None:
            return _LIMP * self.mass_per_length * self.length**2 * math.sqrt(_GRAVITY * self.length)
        omega = _CANTILEVER * math.sqrt(stiffness / self.mass_per_length) / self.length**2
        return 2.0 * self.damping_ratio / omega * stiffness

    @property
    def torsional_damping(self) -> float:
        """Moment per rate of twist, N m^2 s: as much for its stiffness as bending has for its own."""
        if self.torsional_stiffness is None or self.bending_stiffness is None:
            return self.bending_damping
        return self.bending_damping * self.torsional_stiffness / self.bending_stiffness


def properties(material: Material, radius: float, length: float) -> Properties:
    """What follows from the settings for an object of this size. A preset fills in what they leave out.

    Args:
        material: the settings.
        radius: outer radius of the object, metres.
        length: of the whole object, metres.

    Raises:
        ConfigError: the bore is not smaller than the object.
    """
    preset = PRESETS.get(material.preset)
    inner = _inner_radius(material, preset, radius)
    area = math.pi * (radius**2 - inner**2)
    if material.mass != AUTO:
        mass_per_length = material.mass / length
    elif material.mass_per_length != AUTO:
        mass_per_length = material.mass_per_length
    elif material.density != AUTO:
        mass_per_length = material.density * area
    else:
        mass_per_length = (preset.density if preset else GENERIC_DENSITY) * area
    young, shear = _moduli(material, preset)
    damping = None
    if young is not None:
        assumed = preset.damping_ratio if preset else GENERIC_DAMPING_RATIO
        damping = assumed if material.damping_ratio == AUTO else material.damping_ratio
    name = material.name
    if name == AUTO:
        name = material.preset.replace("-", " ") if preset else GENERIC_MATERIAL
    return Properties(name, radius, inner, length, mass_per_length, young, shear, damping)


def _inner_radius(material: Material, preset: Preset | None, radius: float) -> float:
    if material.inner_radius != AUTO:
        inner = material.inner_radius
    elif material.wall_thickness != AUTO:
        inner = radius - material.wall_thickness
    else:
        inner = preset.bore * radius if preset else 0.0
    if not 0.0 <= inner < radius:
        key = "inner_radius" if material.inner_radius != AUTO else "wall_thickness"
        raise ConfigError(
            f"material.{key} = {getattr(material, key):g} m does not fit the radius of {radius:.4g} m",
            "the radius is the outer one; give r if it was estimated wrongly",
        )
    return inner


def _moduli(material: Material, preset: Preset | None) -> tuple[float | None, float | None]:
    """E and G. What is set goes before the preset."""
    young = None if material.youngs_modulus == AUTO else material.youngs_modulus
    shear = None if material.shear_modulus == AUTO else material.shear_modulus
    if material.poissons_ratio != AUTO:
        both = 2.0 * (1.0 + material.poissons_ratio)
        if young is None and shear is not None:
            return shear * both, shear
        young = preset.youngs_modulus if young is None and preset else young
        return young, None if young is None else young / both
    if preset is not None:
        # A softer or harder specimen of the same kind: the preset's ratio of the two stands.
        if young is not None and shear is None:
            return young, young * preset.shear_modulus / preset.youngs_modulus
        return (preset.youngs_modulus if young is None else young), (preset.shear_modulus if shear is None else shear)
    return young, shear
