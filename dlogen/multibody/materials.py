"""What objects are made of: known materials, and the mechanical properties of a cross-section.

The moduli are those of a homogeneous section of the same size, so that E I and G J are the stiffness of the object as
a whole (Timoshenko & Gere, Mechanics of Materials). They are not those of the stuff that a cable is made of: strands
slide on one another and corrugations unfold.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dlogen.config.fields import AUTO
from dlogen.errors import ConfigError

if TYPE_CHECKING:
    from dlogen.config.schema import Material

#: Density where nothing is said, kg/m^3: that of cable sheaths and rubber.
GENERIC_DENSITY = 1200.0

#: Damping ratio where only a modulus is said: an assumption, of the order of what plastics and rubbers have.
GENERIC_DAMPING_RATIO = 0.05

#: 1.875^2, from the first root of cos(x) cosh(x) = -1: the slowest bending vibration of a cantilever is at
#: 3.516 sqrt(E I / (m' L^4)) radians a second (Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1).
_CANTILEVER = 3.5160152685

#: Damping of a limp object; see `Properties.bending_damping`.
_LIMP = 0.005
_GRAVITY = 9.80665


@dataclass(frozen=True)
class Preset:
    """A known material.

    Attributes:
        density: kg/m^3 of the cross-section without its bore.
        youngs_modulus, shear_modulus: Pa, of the homogeneous section that is as stiff.
        damping_ratio: of the slowest bending vibration.
        bore: inner radius over outer radius.
    """

    density: float
    youngs_modulus: float
    shear_modulus: float
    damping_ratio: float
    bore: float = 0.0


PRESETS: Final[Mapping[str, Preset]] = {
    # A corrugated vacuum cleaner hose of 40 mm. All assumed, the paper gives no mass: 0.25 kg/m, a household hose of
    # EVA (930 kg/m^3) whose wall fills about a fifth of the section; E I = 0.3 N m^2, a smooth EVA tube (30 MPa) of 1
    # mm wall has 0.75 and corrugation softens it; G J = 0.4 N m^2, that of the smooth tube (G = 8 MPa), since
    # corrugation hardly softens torsion. Hoses with a steel spiral weigh twice as much: weigh yours.
    "vacuum-hose": Preset(density=199.0, youngs_modulus=2.4e6, shear_modulus=1.6e6, damping_ratio=0.1),
    # Cat 6 U/UTP with solid conductors, 6 mm. 42 kg/km is a usual figure: 0.042 / (pi 0.003^2) = 1485. By
    # construction: 8 copper wires AWG 23 (0.573 mm, 8960 kg/m^3) 18.5 g/m, polyethylene up to 0.98 mm 3.8 g/m, 0.5 mm
    # PVC sheath 12 g/m, filler 3 to 6 g/m: 37 to 40 g/m. E I by construction, wires free to slide: copper 117 GPa
    # 0.0050 N m^2, insulation 0.8 GPa 0.0003, sheath 30 MPa 0.0010; friction between them adds to that: 0.01 N m^2
    # assumed, E = 157 MPa. G = E / 2.8 and the damping of sliding wires: assumed.
    "network-cable": Preset(density=1485.0, youngs_modulus=1.57e8, shear_modulus=5.6e7, damping_ratio=0.2),
    # Kernmantle climbing rope of nylon, 10 mm. Makers give about 62 g/m for single ropes of 9.8 to 10 mm: 0.062 / (pi
    # 0.005^2) = 789, less than nylon (1140) for the air between the fibres. E I = 0.0025 N m^2 assumed, some
    # thousandths of solid nylon's (3 GPa) since fibres slide; G and damping assumed.
    "rope": Preset(density=789.0, youngs_modulus=5.0e6, shear_modulus=2.0e6, damping_ratio=0.3),
    # Silicone laboratory tube of 8 x 12 mm, 55 Shore A: 1150 kg/m^3; E = 3.0 MPa by Gent's relation (Gent 1958,
    # Rubber Chem. Technol. 31: E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)) MPa); incompressible, so G = E
    # / 3; loss factor about 0.1, which is twice the damping ratio.
    "silicone-tube": Preset(
        density=1150.0, youngs_modulus=3.0e6, shear_modulus=1.0e6, damping_ratio=0.05, bore=8.0 / 12.0
    ),
    # Solid spring steel wire: EN 10270-1 gives E = 206 GPa, G = 81.5 GPa and 7850 kg/m^3. Damping of 1 % is assumed:
    # that of steel with its clamp. Of a wire rope, steel fills only some 60 % of the section, and its strands slide.
    "steel-wire": Preset(density=7850.0, youngs_modulus=2.06e11, shear_modulus=8.15e10, damping_ratio=0.01),
}


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
        name = material.preset.replace("-", " ") if preset else "generic"
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
