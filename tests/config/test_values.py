"""Nested data to values by dotted key."""

from __future__ import annotations

import pytest
from configurations import refused

from dlogen.config.reader import load_config
from dlogen.config.schema import Config, config_keys
from dlogen.config.values import flat, nested
from dlogen.errors import ConfigError


def test_beta_in_both_spellings(write):
    assert load_config(write("β: 1e-2\n")).beta == load_config(None, ["β=0.01"]).beta == 0.01
    assert Config.from_dict({"β": 0.01}).beta == 0.01
    assert Config().replace({"β": 0.01}).beta == 0.01


def test_both_spellings_of_a_key(write):
    error = refused(write("beta: 0.01\nr: 0.01\nβ: 0.02\n"))
    assert error.message == "line 3: β and beta in line 1 are the same key"
    with pytest.raises(ConfigError, match="β and beta are the same key"):
        Config.from_dict({"beta": 1, "β": 1})


def test_dotted_keys_belong_to_overrides(write):
    error = refused(write("normals.neighbours: 12\n"))
    assert error.hint == "write it in its section: normals: {neighbours: ...}"


@pytest.mark.parametrize(
    "content", ["", "# nothing\n", "---\n", "\ufeff", "normals:\n", "normals:\n  # radius: 2\nmaterial: {}\n"]
)
def test_empty_files_and_sections_are_default(write, content):
    assert load_config(write(content)) == Config()


def test_file_with_everything(write):
    path = write(
        "profile: paper\nunits: mm\nr: 0.02\nr_n: 0.16\nN: 21\nbeta: 1e-2\ne_max: 1.0e-2\nseed: 7\n"
        "length: 1.5\nbridge: all\nmesh: sample\n"
        "normals: {neighbours: 12, orientation: outward}\nprojection:\n  enabled: false\nsorting: {start: 4}\n"
        "skeleton: {tau: 5.25}\nsegmentation: {criterion: fewest, placement: minimax, min_last: 0}\n"
        "mdtw: {samples: 500}\n"
        "joints: {dof: 3, base: floating, zero: straight, rest: scan, min_bend_radius: 0.1}\n"
        "material:\n  preset: rope\n  name: hose\n  density: 199\n  inner_radius: 0.01\n  youngs_modulus: 2e6\n"
        "  poissons_ratio: 0.4\n  damping_ratio: 0.1\nreport: {timings: false}\n"
        "frame: {name: camera_link, convention: optical-to-ros, z: 1, yaw: -0.5}\n"
    )
    assert load_config(path).to_dict() == {
        "profile": "paper",
        "units": "mm",
        "r": 0.02,
        "r_n": 0.16,
        "N": 21,
        "beta": 0.01,
        "e_max": 0.01,
        "length": 1.5,
        "bridge": "all",
        "mesh": "sample",
        "seed": 7,
        "normals": {"neighbours": 12, "radius": "auto", "orientation": "outward"},
        "projection": {"enabled": False},
        "sorting": {"start": 4},
        "skeleton": {"tau": 5.25},
        "segmentation": {
            "criterion": "fewest",
            "placement": "minimax",
            "segments": "auto",
            "segment_length": "auto",
            "curvature_max": "auto",
            "min_bend_radius": "auto",
            "min_last": 0.0,
        },
        "mdtw": {"samples": 500},
        "joints": {"dof": 3, "base": "floating", "zero": "straight", "rest": "scan", "min_bend_radius": 0.1},
        "material": {
            "preset": "rope",
            "name": "hose",
            "density": 199.0,
            "mass": "auto",
            "mass_per_length": "auto",
            "inner_radius": 0.01,
            "wall_thickness": "auto",
            "youngs_modulus": 2e6,
            "shear_modulus": "auto",
            "poissons_ratio": 0.4,
            "damping_ratio": 0.1,
        },
        "frame": {
            "name": "camera_link",
            "use_viewpoint": False,
            "convention": "optical-to-ros",
            "x": 0.0,
            "y": 0.0,
            "z": 1.0,
            "roll": 0.0,
            "pitch": 0.0,
            "yaw": -0.5,
        },
        "report": {"timings": False, "alternatives": False},
    }


def test_flat_and_nested_are_opposites():
    data = Config(r=0.02).to_dict()
    values = flat(data)
    assert (values["r"], values["normals.neighbours"], values["report.timings"]) == (0.02, "auto", True)
    assert list(values) == list(config_keys().settings)
    assert nested(values) == data
    assert list(nested(values)) == list(data)
    assert flat({}) == nested({}) == {}
