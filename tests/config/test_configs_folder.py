"""The configurations that come with the project: they load, they are valid, and their figures are what they say."""

from __future__ import annotations

import math

import pytest
import yaml
from jsonschema import Draft202012Validator
from places import ROOT

from dlogen.config.reader import load_config
from dlogen.config.rendering import json_schema, to_yaml
from dlogen.config.schema import Config
from dlogen.config.sections import Material
from dlogen.multibody.materials import properties

FOLDER = ROOT / "configs"
MATERIALS = ["vacuum_hose", "network_cable", "rope", "silicone_tube", "steel_wire"]


def load(name: str) -> Config:
    return load_config(FOLDER / f"{name}.yaml")


def test_the_folder_holds_the_default_the_paper_and_the_materials():
    expected = {f"{name}.yaml" for name in ["default", "paper", *MATERIALS]}
    assert {path.name for path in FOLDER.iterdir()} == {"README.md", *expected}


@pytest.mark.parametrize("name", ["default", "paper", *MATERIALS])
def test_loads_and_is_valid_by_the_schema(name):
    load(name)
    with (FOLDER / f"{name}.yaml").open(encoding="utf-8") as stream:
        Draft202012Validator(json_schema()).validate(yaml.safe_load(stream))


def test_default_is_generated():
    assert (FOLDER / "default.yaml").read_bytes() == to_yaml(Config()).encode()
    assert load("default") == Config()


def test_paper_has_the_parameters_of_the_paper():
    config = load("paper")
    assert config.profile == "paper"
    assert (config.r, config.r_n, config.e_max) == (0.02, 0.16, 0.01)  # Table III
    assert (config.N, config.beta, config.skeleton.tau) == (21, 0.01, 21 / 4)  # section IV.B
    assert config.mdtw.samples == 1000  # Table II


@pytest.mark.parametrize(
    ("name", "diameter", "mass_per_length"),
    [
        ("vacuum_hose", 0.040, 0.250),
        ("network_cable", 0.006, 0.042),
        ("rope", 0.010, 0.062),
        ("silicone_tube", 0.012, 1150 * math.pi / 4 * (0.012**2 - 0.008**2)),
        ("steel_wire", 0.003, 7850 * math.pi / 4 * 0.003**2),
    ],
)
def test_material(name, diameter, mass_per_length):
    config = load(name)
    assert config.profile == "refined"
    assert config.material == Material(preset=name.replace("_", "-"))
    assert config.r == pytest.approx(diameter / 2)
    found = properties(config.material, config.r, 1.0)
    assert found.name == name.replace("_", " ")
    assert found.mass_per_length == pytest.approx(mass_per_length, rel=0.005)
    # Materials say what is known of the object; the rest is left to the cloud.
    assert config == Config(r=config.r, e_max=config.e_max, material=config.material)
    assert config.e_max <= 2 * config.r
