"""Known materials: what `material.preset` fills in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

#: What `material.preset` is where the material is not a known one.
NO_PRESET: Final = "none"


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
