"""Known materials: they are offered, and have the stiffness that the comments beside them derive."""

from __future__ import annotations

import math

import pytest
from configurations import KEYS

from dlogen.config.presets import NO_PRESET, PRESETS
from dlogen.config.schema import Config


def test_the_presets_are_what_can_be_chosen():
    assert KEYS.settings["material.preset"].choices == (NO_PRESET, *PRESETS)
    assert Config().material.preset == NO_PRESET
    assert NO_PRESET not in PRESETS


@pytest.mark.parametrize(
    ("name", "diameter", "bending"),
    [("vacuum-hose", 0.040, 0.3), ("network-cable", 0.006, 0.01), ("rope", 0.010, 0.0025)],
)
def test_bending_stiffness(name, diameter, bending):
    """E I in N m^2 of the specimen that the preset was made from."""
    assert PRESETS[name].youngs_modulus * math.pi * diameter**4 / 64 == pytest.approx(bending, rel=0.03)


def test_torsional_stiffness_of_the_hose():
    assert PRESETS["vacuum-hose"].shear_modulus * math.pi * 0.040**4 / 32 == pytest.approx(0.4, rel=0.03)


def test_shear_moduli_of_solids():
    ratio = {name: item.youngs_modulus / item.shear_modulus for name, item in PRESETS.items()}
    assert ratio["network-cable"] == pytest.approx(2.8, rel=0.01)
    assert ratio["silicone-tube"] == pytest.approx(3.0)  # incompressible
    assert ratio["steel-wire"] == pytest.approx(206 / 81.5, rel=0.01)  # EN 10270-1


def test_gents_relation_for_silicone():
    shore = 55
    gent = 0.0981 * (56 + 7.62336 * shore) / (0.137505 * (254 - 2.54 * shore)) * 1e6
    assert PRESETS["silicone-tube"].youngs_modulus == pytest.approx(gent, rel=0.02)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_physical(name):
    preset = PRESETS[name]
    assert 0 <= preset.bore < 1
    assert 0 < preset.damping_ratio < 1
    assert min(preset.density, preset.youngs_modulus, preset.shear_modulus) > 0
