"""Defaults that others than the declaration of their key need as well: stages, models and commands that do without one.

The declarations (`dlogen.config.sections`, `dlogen.config.schema`) and their help take them from here. Nothing is
imported, so that a number does not cost the whole configuration.
"""

from __future__ import annotations

from typing import Final

#: N in the profile paper (IV.B).
PAPER_SIZE: Final = 21

#: `skeleton.tau: auto` is N over this (IV.B, where tau is printed as k).
N_PER_TAU: Final = 4

#: `e_max: auto` is r over this, the paper's ratio (Table III: 10 mm for r = 20 mm).
R_PER_E_MAX: Final = 2

#: `mdtw.samples`, as in the paper's Table II.
MDTW_SAMPLES: Final = 1000

#: `segmentation.placement`: the joints of Eq. 18.
PLACEMENT: Final = "on-curve"

#: `segmentation.min_last`.
MIN_LAST: Final = 0.5

#: `material.name: auto` where there is no preset.
GENERIC_MATERIAL: Final = "generic"

#: `material.density: auto` where nothing is said, kg/m^3: that of cable sheaths and rubber.
GENERIC_DENSITY: Final = 1200.0

#: `material.damping_ratio: auto` where only a modulus is said: an assumption, of the order of what plastics and rubbers
#: have.
GENERIC_DAMPING_RATIO: Final = 0.05

#: `frame.name: auto` in the chain.
CHAIN_FRAME: Final = "cloud"

#: `frame.name: auto` in the models.
ROOT_LINK: Final = "base_link"
