"""Mass, stiffness and damping from the settings, against figures worked out by hand."""

from __future__ import annotations

import math

import pytest

from dlogen.config.presets import PRESETS
from dlogen.config.reader import load_config
from dlogen.config.schema import Config
from dlogen.config.sections import Material
from dlogen.errors import ConfigError
from dlogen.multibody.materials import properties


def test_generic_is_limp():
    found = properties(Material(), 0.01, 2.0)
    assert found.name == "generic"
    assert found.mass == pytest.approx(1200 * math.pi * 1e-4 * 2)
    assert found.bending_stiffness is found.torsional_stiffness is found.damping_ratio is None
    # A little, or simulations of it gain energy.
    assert found.bending_damping == pytest.approx(0.005 * found.mass_per_length * 4 * math.sqrt(9.80665 * 2))
    assert found.torsional_damping == found.bending_damping


@pytest.mark.parametrize(
    ("given", "mass"),
    [
        ({"density": 1000}, 1000 * math.pi * (0.02**2 - 0.015**2) * 0.5),
        ({"mass": 0.3}, 0.3),
        ({"mass_per_length": 0.3}, 0.15),
        ({"preset": "rope", "mass": 0.3}, 0.3),
    ],
)
@pytest.mark.parametrize("bore", [{"inner_radius": 0.015}, {"wall_thickness": 0.005}])
def test_mass_of_a_hollow_section(given, mass, bore):
    found = properties(Material(**given, **bore), 0.02, 0.5)
    assert found.mass == pytest.approx(mass, rel=1e-12)
    assert found.inner_radius == pytest.approx(0.015)
    assert found.second_moment == pytest.approx(math.pi / 4 * (0.02**4 - 0.015**4))


@pytest.mark.parametrize(
    ("given", "young", "shear"),
    [
        ({"youngs_modulus": 3e6}, 3e6, None),
        ({"youngs_modulus": 3e6, "poissons_ratio": 0.5}, 3e6, 1e6),
        ({"shear_modulus": 1e6, "poissons_ratio": 0.5}, 3e6, 1e6),
        ({"youngs_modulus": 3e6, "shear_modulus": 7e6}, 3e6, 7e6),
        ({"preset": "steel-wire"}, 206e9, 81.5e9),
        ({"preset": "steel-wire", "youngs_modulus": 103e9}, 103e9, 40.75e9),
        ({"preset": "steel-wire", "shear_modulus": 70e9}, 206e9, 70e9),
        ({"preset": "steel-wire", "poissons_ratio": 0.0}, 206e9, 103e9),
        ({"preset": "steel-wire", "shear_modulus": 70e9, "poissons_ratio": 0.0}, 140e9, 70e9),
    ],
)
def test_moduli(given, young, shear):
    found = properties(Material(**given), 0.01, 1.0)
    assert found.youngs_modulus == pytest.approx(young)
    assert found.shear_modulus == (None if shear is None else pytest.approx(shear))
    assert found.bending_stiffness == pytest.approx(young * math.pi / 4 * 1e-8)
    assert found.torsional_stiffness == (None if shear is None else pytest.approx(shear * math.pi / 2 * 1e-8))


def test_damping_ratio_is_that_of_the_slowest_vibration_of_a_cantilever():
    found = properties(Material(preset="steel-wire", damping_ratio=0.02), 0.0015, 0.8)
    # First natural frequency of a clamped wire: (1.87510407 / L)^2 sqrt(E I / m'), about 3.3 Hz here.
    omega = (1.87510407 / 0.8) ** 2 * math.sqrt(206e9 * math.pi / 4 * 0.0015**4 / (7850 * math.pi * 0.0015**2))
    assert found.bending_damping / found.bending_stiffness == pytest.approx(2 * 0.02 / omega, rel=1e-6)
    assert found.torsional_damping / found.torsional_stiffness == pytest.approx(2 * 0.02 / omega, rel=1e-6)
    assert properties(Material(youngs_modulus=1e9), 0.01, 1).damping_ratio == 0.05


def test_a_silicone_tube_keeps_its_proportions():
    found = properties(Material(preset="silicone-tube"), 0.003, 1.0)
    assert found.inner_radius == pytest.approx(0.002)
    assert properties(Material(preset="silicone-tube", inner_radius=0), 0.003, 1.0).inner_radius == 0


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_are_isotropic_or_nearly_so(preset):
    known = PRESETS[preset]
    # Thermodynamics allows E / 3 <= G for isotropic stuff; composites may differ by a factor, not by orders.
    assert 1 / 4 < known.shear_modulus / known.youngs_modulus < 1
    assert 0 < known.damping_ratio < 1


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"inner_radius": 0.01}, "material.inner_radius = 0.01 m does not fit the radius of 0.01 m"),
        ({"wall_thickness": 0.02}, "material.wall_thickness = 0.02 m does not fit the radius of 0.01 m"),
    ],
)
def test_a_bore_that_does_not_fit(given, says):
    with pytest.raises(ConfigError, match=says) as caught:
        properties(Material(**given), 0.01, 1.0)
    assert "give r" in caught.value.hint


@pytest.mark.parametrize(
    ("overrides", "says", "hint"),
    [
        (["material.density=1000", "material.mass=1"], "density = 1000.0 .* and .*mass = 1.0", "set one"),
        (["material.mass=1", "material.mass_per_length=1"], "contradict each other", "set one"),
        (["material.inner_radius=0.01", "material.wall_thickness=0.01"], "contradict each other", "set one"),
        (
            ["material.youngs_modulus=1e6", "material.shear_modulus=1e6", "material.poissons_ratio=0.3"],
            "youngs_modulus .* and .*shear_modulus .* and .*poissons_ratio .* contradict",
            "set two",
        ),
        (["r=0.01", "material.inner_radius=0.02"], r"inner_radius = 0.02 .* is not less than r = 0.01", "outer"),
        (["material.shear_modulus=1e6"], "says nothing of the bending stiffness", "youngs_modulus"),
        (["material.youngs_modulus=1e6", "joints.dof=3"], "says nothing of the torsional stiffness", "joints.dof"),
        (["material.poissons_ratio=0.3"], "no modulus is known", "preset"),
        (["material.damping_ratio=0.3"], "no modulus is known", "preset"),
    ],
)
def test_contradictory_or_missing_data(overrides, says, hint):
    with pytest.raises(ConfigError, match=says) as caught:
        load_config(None, overrides)
    assert hint in caught.value.hint
    assert caught.value.exit_code == 2


def test_a_preset_contradicts_nothing():
    config = Config.from_dict(
        {"joints": {"dof": 3}, "material": {"preset": "rope", "mass": 1, "shear_modulus": 1e6, "damping_ratio": 0.5}}
    )
    found = properties(config.material, 0.005, 2.0)
    assert (found.mass, found.shear_modulus, found.damping_ratio) == (1, 1e6, 0.5)
