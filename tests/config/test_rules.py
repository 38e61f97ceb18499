"""Keys that contradict each other."""

from __future__ import annotations

import pytest
from configurations import refused

from dlogen.config.reader import load_config
from dlogen.config.schema import Config
from dlogen.errors import ConfigError


def test_search_radius_below_the_diameter(write):
    error = refused(write("N: 21\nr_n: 0.03\nr: 0.02\n"))
    assert "r_n = 0.03" in error.message
    assert "line 2)" in error.message
    assert "diameter 2 r = 0.04, with r = 0.02" in error.message
    assert "line 3)" in error.message
    assert "III.B" in error.hint
    error = refused(write("r_n: 0.03\n"), ["r=0.02"])
    assert "(--set r=0.02)" in error.message
    assert load_config(write("r_n: 0.03\n"), ["r=0.015"]).r_n == 0.03
    for make in (lambda: Config(r=0.02, r_n=0.03), lambda: Config.from_dict({"r": 0.02, "r_n": 0.03})):
        with pytest.raises(ConfigError, match=r"^r_n = 0\.03 is less than the diameter 2 r = 0\.04, with r = 0\.02 \("):
            make()


def test_neighbours_and_radius_of_normals():
    error = refused(None, ["normals.neighbours=12", "normals.radius=0.01"])
    assert "normals.neighbours = 12" in error.message
    assert "normals.radius = 0.01" in error.message
    assert "set one" in error.hint
    assert load_config(None, ["normals.neighbours=12", "normals.radius=0.01", "normals.neighbours=auto"])


@pytest.mark.parametrize(
    "pair",
    [
        ["segments=16", "segment_length=0.1"],
        ["segments=16", "min_bend_radius=0.1"],
        ["curvature_max=5", "min_bend_radius=0.2"],
        ["criterion=paper", "segments=16"],
        ["criterion=fewest", "segment_length=0.1"],
        ["criterion=fewest", "curvature_max=5"],
        ["placement=minimax", "segments=16"],
        ["placement=minimax", "min_bend_radius=0.1"],
        ["placement=minimax", "criterion=paper"],
    ],
)
def test_segments_are_given_in_one_way(pair):
    error = refused(None, [f"segmentation.{item}" for item in pair])
    for item in pair:
        assert f"segmentation.{item.replace('=', ' = ')}" in error.message
    # Each alone is fine, and the one that is taken back, too.
    for item in pair:
        assert load_config(None, [f"segmentation.{item}"])
    last = pair[1].split("=")[0]
    assert load_config(None, [*(f"segmentation.{item}" for item in pair), f"segmentation.{last}=auto"])


def test_the_paper_a_priori_is_no_contradiction():
    assert load_config(None, ["segmentation.criterion=paper", "segmentation.curvature_max=5"])
    assert load_config(None, ["segmentation.criterion=fewest", "segmentation.placement=minimax"])


def test_the_paper_has_its_joints_on_the_line():
    error = refused(None, ["profile=paper", "segmentation.placement=minimax"])
    assert "profile paper has its joints on the line" in error.message
    assert "criterion to fewest" in error.hint
    assert load_config(None, ["profile=paper", "segmentation.placement=minimax", "segmentation.criterion=fewest"])


@pytest.mark.parametrize(("units", "metres"), [("mm", "0.02"), ("cm", "0.2")])
@pytest.mark.parametrize("key", ["r", "e_max"])
def test_lengths_in_the_units_of_the_cloud(units, metres, key):
    error = refused(None, [f"units={units}", f"{key}=20"])
    assert f"{key} = 20.0" in error.message
    assert f"20 {units} is {metres}" in error.hint
    assert load_config(None, [f"{key}=20"])
    assert load_config(None, [f"units={units}", f"{key}=0.02"])
