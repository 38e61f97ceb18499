"""The configuration: precedence, checks, messages that name key, line and remedy."""

from __future__ import annotations

import io
import math
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, fields
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from dlogen.config.fields import AUTO
from dlogen.config.reader import load_config
from dlogen.config.rendering import json_schema, to_yaml
from dlogen.config.schema import Config, config_keys
from dlogen.config.sections import JointSettings, Material, Normals, Segmentation
from dlogen.errors import ConfigError

KEYS = config_keys()


@pytest.fixture
def write(tmp_path):
    def write(content: str | bytes):
        path = tmp_path / "cfg.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def refused(*args, **kwargs) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        load_config(*args, **kwargs)
    error = caught.value
    assert error.exit_code == 2
    assert error.message
    assert error.hint
    return error


# --- what it is ---


def test_defaults():
    config = Config()
    assert config == load_config() == Config.from_dict({})
    assert (config.profile, config.units, config.seed) == ("refined", "m", 0)
    assert [config.r, config.r_n, config.N, config.beta, config.e_max] == [AUTO] * 5
    assert config.normals == Normals(AUTO, AUTO, AUTO)
    assert config.projection.enabled is True
    assert config.sorting.start == config.skeleton.tau == AUTO
    assert config.segmentation == Segmentation(AUTO, "on-curve", AUTO, AUTO, AUTO, AUTO, 0.5)
    assert config.mdtw.samples == 1000
    assert config.joints == JointSettings(2, "fixed", "scan", "straight", AUTO)
    assert config.material == Material("none", *[AUTO] * 10)
    assert config.report.timings is True


def test_every_field_is_a_declared_setting_or_a_section():
    assert [item.name for item in fields(Config)] == [*KEYS.of_section(""), *KEYS.sections]
    assert all(setting.help.endswith(".") for setting in KEYS.settings.values())
    assert all(about for about in KEYS.sections.values())


def test_it_is_frozen_hashable_and_picklable():
    config = Config(r=0.02)
    with pytest.raises(FrozenInstanceError):
        config.r = 0.03
    assert len({config, Config(r=0.02), Config(r=0.03)}) == 2
    assert pickle.loads(pickle.dumps(config)) == config


def test_importing_it_imports_neither_yaml_nor_numpy():
    code = (
        "import sys, dlogen.config.reader as c; c.load_config(None, ['r=0.02']); "
        "print([*{'yaml', 'numpy'} & {*sys.modules}])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


# --- where values come from ---


def test_precedence_is_last_override_then_file_then_default(write):
    path = write("r: 0.01\ne_max: 0.002\nN: 30\n")
    config = load_config(path, ["e_max=0.003", "N=31", "N=32"])
    assert (config.r, config.e_max, config.N, config.beta) == (0.01, 0.003, 32, AUTO)


def test_an_override_can_go_back_to_auto(write):
    assert load_config(write("r: 0.01\n"), ["r=auto"]).r == AUTO


def test_file_with_everything(write):
    path = write(
        "profile: paper\nunits: mm\nr: 0.02\nr_n: 0.16\nN: 21\nbeta: 1e-2\ne_max: 1.0e-2\nseed: 7\n"
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


@pytest.mark.parametrize("override", ["normals.neighbours=20", " normals.neighbours = 20 ", "normals.neighbours=20.0"])
def test_dotted_override(override):
    assert load_config(None, [override]).normals.neighbours == 20


def test_beta_in_both_spellings(write):
    assert load_config(write("β: 1e-2\n")).beta == load_config(None, ["β=0.01"]).beta == 0.01
    assert Config.from_dict({"β": 0.01}).beta == 0.01
    assert Config().replace({"β": 0.01}).beta == 0.01


def test_override_of_a_text_is_taken_as_it_is():
    assert load_config(None, ["material.name=316"]).material.name == "316"
    assert load_config(None, ["material.name=a: b = #c"]).material.name == "a: b = #c"


def test_numbers_are_stored_with_the_type_of_their_field(write):
    config = load_config(write("r: 1\nN: 21.0\nmdtw: {samples: 1e3}\n"))
    assert (config.r, config.N, config.mdtw.samples) == (1.0, 21, 1000)
    assert [type(value) for value in (config.r, config.N, config.mdtw.samples)] == [float, int, int]


def test_numbers_of_other_libraries(write):
    config = Config(r=np.float64(0.02), N=np.int64(21), beta=Fraction(1, 100))
    assert [type(value) for value in (config.r, config.N, config.beta)] == [float, int, float]


@pytest.mark.parametrize(
    "content", ["", "# nothing\n", "---\n", "\ufeff", "normals:\n", "normals:\n  # radius: 2\nmaterial: {}\n"]
)
def test_empty_files_and_sections_are_default(write, content):
    assert load_config(write(content)) == Config()


def test_byte_order_mark_and_crlf(write):
    assert load_config(write(b"\xef\xbb\xbfr: 0.02\r\nnormals:\r\n  neighbours: 12\r\n")).normals.neighbours == 12


def test_standard_input(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"r: 0.02\nN: x\n")))
    error = refused("-")
    assert str(error).startswith("standard input: line 2: N = 'x'")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"r: 0.02\n")))
    assert load_config("-").r == 0.02


def test_replace():
    config = Config(r=0.02).replace({"normals.neighbours": 20}, e_max=0.005)
    assert (config.r, config.e_max, config.normals.neighbours) == (0.02, 0.005, 20)
    assert config.replace(r=AUTO).r == AUTO
    with pytest.raises(ConfigError, match="unknown key 'emax'"):
        config.replace(emax=1)
    with pytest.raises(ConfigError, match="is less than the diameter"):
        config.replace(r_n=0.03)


# --- what is refused, and how ---


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("neighbors", "normals.neighbours"),
        ("neighbour", "normals.neighbours"),
        ("k", "normals.neighbours"),
        ("radius", "'r' or 'normals.radius'"),
        ("diameter", "'r'"),
        ("emax", "'e_max'"),
        ("e-max", "'e_max'"),
        ("max_error", "'e_max'"),
        ("tolerence", "'e_max'"),
        ("n", "'N'"),
        ("R", "'r'"),
        ("rn", "'r_n'"),
        ("Beta", "'beta'"),
        ("betta", "'beta'"),
        ("lambda", "'beta'"),
        ("profil", "'profile'"),
        ("unit", "'units'"),
        ("density", "'material.density'"),
        ("tau", "'skeleton.tau'"),
        ("samples", "'mdtw.samples'"),
        ("normal", "'normals'"),
        ("skelton", "'skeleton'"),
    ],
)
def test_unknown_key_names_the_nearest(write, key, near):
    error = refused(write(f"seed: 1\n{key}: 2\n"))
    assert error.message == f"line 2: unknown key '{key}'"
    assert error.hint.startswith("did you mean ")
    assert near in error.hint
    assert str(error.path).endswith("cfg.yaml")
    assert refused(None, [f"{key}=2"]).hint == error.hint


@pytest.mark.parametrize(
    ("content", "line", "key", "near"),
    [
        ("normals:\n  neighbors: 2\n", 2, "normals.neighbors", "'normals.neighbours'"),
        ("normals: {density: 2}\n", 1, "normals.density", "'material.density'"),
        ("material:\n  rho: 2\n", 2, "material.rho", "'material.density'"),
        ("mdtw:\n  sample: 2\n", 2, "mdtw.sample", "'mdtw.samples'"),
    ],
)
def test_unknown_key_in_a_section(write, content, line, key, near):
    error = refused(write(content))
    assert error.message == f"line {line}: unknown key '{key}'"
    assert error.hint == f"did you mean {near}?"


def test_unknown_key_that_resembles_none_lists_the_known(write):
    error = refused(write("qqqq: 1\n"))
    assert error.hint.startswith("known keys: profile, units, r, ")
    assert "normals" in error.hint
    assert refused(write("mdtw: {qqqq: 1}\n")).hint == "known in mdtw: samples"


def test_dotted_keys_belong_to_overrides(write):
    error = refused(write("normals.neighbours: 12\n"))
    assert error.hint == "write it in its section: normals: {neighbours: ...}"


@pytest.mark.parametrize(
    ("content", "says", "hint"),
    [
        ("r: '0.02'", "r = '0.02': expected a number > 0 (m), or auto", "without quotes"),
        ("r: 0,02", "r = '0,02': expected a number", "decimal mark is a point"),
        ("r: 20 mm", "r = '20 mm': expected a number", "metres, without a unit: 0.02"),
        ("e_max: .5cm", "e_max = '.5cm'", "metres, without a unit: 0.005"),
        ("r: Auto", "r = 'Auto'", "small letters"),
        ("r: thick", "r = 'thick'", "Radius"),
        ("r: 1:30", "r = '1:30': expected a number", "Radius"),
        ("r: 1_000", "r = '1_000': expected a number", "Radius"),
        ("r: true", "r = true: expected a number", "Radius"),
        ("r: on", "r = 'on': expected a number", "Radius"),
        ("r:", "r = nothing: expected a number", "leave the key out"),
        ("r: ~", "r = nothing: expected a number", "write auto"),
        ("r: [1, 2]", "r = a list: expected a number", "Radius"),
        ("r: {x: 1}", "r = a section: expected a number", "Radius"),
        ("r: 0", "r = 0: expected a number > 0", "Radius"),
        ("r: -0.02", "r = -0.02: expected a number > 0", "Radius"),
        ("r: .inf", "r = inf: expected a number > 0", "finite"),
        ("r: .nan", "r = nan: expected a number > 0", "finite"),
        ("r: 1e999", "r = inf: expected a number > 0", "finite"),
        ("e_max: 0", "e_max = 0: expected a number > 0", "skeleton line and the chain"),
        ("e_max: -1e-3", "e_max = -0.001: expected a number > 0", "skeleton line and the chain"),
        ("r_n: 0", "r_n = 0: expected", "Search radius"),
        ("N: 3", "N = 3: expected a whole number >= 4 and <= 2000, or auto", "basis functions"),
        ("N: 1e9", "N = 1000000000.0: expected a whole number >= 4 and <= 2000", "basis functions"),
        ("N: 21.5", "N = 21.5: expected a whole number", "it must be whole"),
        ("beta: -1", "beta = -1: expected a number >= 0", "Regularisation"),
        ("seed: auto", "seed = 'auto': expected a whole number >= 0", "Seed"),
        ("seed: " + "9" * 50, "seed = a very large number: expected a whole number", "Seed"),
        ("profile: Paper", "profile = 'Paper': expected one of refined, paper", "did you mean 'paper'?"),
        ("profile: 1", "profile = 1: expected one of refined, paper", "refined: as good"),
        ("units: meters", "units = 'meters': expected one of m, mm, cm, auto", "numbers in the cloud"),
        ("units: no", "units = 'no': expected one of m, mm, cm, auto", "numbers in the cloud"),
        ("normals: 5", "normals = 5: expected a section", "its keys: neighbours, radius, orientation"),
        ("normals: [neighbours]", "normals = a list: expected a section", "its keys"),
        ("normals: {neighbours: 2}", "normals.neighbours = 2: expected a whole number >= 3", "nearest points"),
        ("normals: {radius: 0}", "normals.radius = 0: expected a number > 0", "Fit"),
        ("normals: {orientation: inward}", "normals.orientation = 'inward': expected one of", "Which side"),
        ("projection: {enabled: yes}", "projection.enabled = 'yes': expected true or false", "write true or false"),
        ("projection: {enabled: 1}", "projection.enabled = 1: expected true or false", "write true or false"),
        ("sorting: {start: -1}", "sorting.start = -1: expected a whole number >= 0", "Index"),
        ("skeleton: {tau: 0}", "skeleton.tau = 0: expected a number > 0", "Width"),
        (
            "segmentation: {criterion: mine}",
            "segmentation.criterion = 'mine': expected one of auto, paper, fewest",
            "Eq. 17",
        ),
        ("mdtw: {samples: 1}", "mdtw.samples = 1: expected a whole number >= 2 and <= 20000", "sampled"),
        ("mdtw: {samples: 20001}", "mdtw.samples = 20001: expected", "sampled"),
        ("material: {density: 0}", "material.density = 0: expected a number > 0 (kg/m^3)", "Mass per volume"),
        ("material: {name: 316}", "material.name = 316: expected text", "quotes"),
        ("material: {name: ''}", "material.name = '': expected text of 1 to 100", "Name"),
        ('material: {name: "a\\nb"}', "material.name = 'a\\nb': expected text", "Name"),
        ('material: {name: "\\ud800"}', "material.name = '\\ud800': expected text", "Name"),
        (f"material: {{name: {'x' * 101}}}", "material.name = 'xxx", "Name"),
        ("report: {timings: off}", "report.timings = 'off': expected true or false", "write true or false"),
        ("- r: 1", "expected keys and values, got a list", "key: value"),
        ("0.02", "expected keys and values, got 0.02", "key: value"),
    ],
)
def test_wrong_value(write, content, says, hint):
    error = refused(write(f"# comment\n{content}\n"))
    assert says in error.message
    assert hint in error.hint
    if "keys and values" not in says:
        assert error.message.startswith("line 2: ")


@pytest.mark.parametrize("value", [2**2000, Fraction(10) ** 400])
def test_numbers_beyond_floats(value):
    with pytest.raises(ConfigError) as caught:
        Config.from_dict({"r": value})
    assert caught.value.hint == "it must be finite"


def test_010_is_ten(write):
    assert load_config(write("N: 010\n")).N == 10


def test_key_given_twice(write):
    error = refused(write("r: 0.01\nN: 21\nr: 0.02\n"))
    assert error.message == "line 3: 'r' is given twice, first in line 1"
    error = refused(write("normals:\n  radius: 0.01\n  radius: 0.01\n"))
    assert error.message == "line 3: 'normals.radius' is given twice, first in line 2"
    error = refused(write("mdtw: {samples: 5}\nr: 0.01\nmdtw: {samples: 5}\n"))
    assert error.message == "line 3: 'mdtw' is given twice, first in line 1"


def test_both_spellings_of_a_key(write):
    error = refused(write("beta: 0.01\nr: 0.01\nβ: 0.02\n"))
    assert error.message == "line 3: β and beta in line 1 are the same key"
    with pytest.raises(ConfigError, match="β and beta are the same key"):
        Config.from_dict({"beta": 1, "β": 1})


def test_all_that_is_wrong_with_a_file_is_named_at_once_in_its_order(write):
    error = refused(write("r: x\nemax: 1\nnormals:\n  neighbours: 1\nN: 21\nN: 22\nseed: 1\n"))
    lines = error.message.splitlines()
    assert lines[0] == "4 problems:"
    assert [line.split(":")[0].strip() for line in lines[1:]] == ["line 1", "line 2", "line 4", "line 6"]
    assert "(did you mean 'e_max'?)" in lines[2]
    assert str(error).startswith(f"{error.path}: 4 problems:")


def test_syntax_error_names_file_and_line(write):
    error = refused(write("r: 1\nnormals:\n\tradius: 2\n"))
    assert str(error.path).endswith("cfg.yaml")
    assert error.message.startswith("line 3: ")
    assert "tab" in error.message


@pytest.mark.parametrize(
    ("override", "says", "hint"),
    [
        ("r", "--set r: expected KEY=VALUE", "--set e_max=0.005"),
        ("=1", "unknown key ''", "known keys"),
        ("r=", "--set r=: r = nothing: expected a number", "leave the key out"),
        ("r=-1", "--set r=-1: r = -1: expected a number > 0", "Radius"),
        ("projection.enabled=no", "projection.enabled = 'no': expected true or false", "true or false"),
        ("normals=3", "--set normals=3: normals is a section", "--set normals.neighbours=..."),
        ("material.name=", "material.name = '': expected text", "Name"),
        ("e_max=0.005=1", "e_max = '0.005=1'", "Largest"),
        ("r=\udcff\x1b[31m", r"--set 'r=\udcff\x1b[31m'", "Radius"),
        (f"r={'x' * 200}", "...: r = ", "Radius"),
    ],
)
def test_wrong_override(override, says, hint):
    error = refused(None, [override])
    assert says in error.message
    assert hint in error.hint
    error.message.encode()
    assert len(error.message) < 250


def test_all_that_is_wrong_with_overrides_is_named_at_once():
    error = refused(None, ["r=x", "emax=1", "N=30"])
    assert error.message.startswith("2 problems:\n  --set r=x: ")
    assert error.path is None


def test_a_broken_file_is_not_mended_by_an_override(write):
    assert "r = -1" in refused(write("r: -1\n"), ["r=0.02"]).message


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


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Config(r=-1), "r = -1: expected"),
        (lambda: Config(r="0.02"), "r = '0.02': expected"),
        (lambda: Config(r=np.bool_(True)), "r = .*: expected"),
        (lambda: Config(r=np.array([0.02])), "r = .*: expected"),
        (lambda: Config(normals={"neighbours": 12}), r"normals = a section: expected Normals\(...\)"),
        (lambda: Normals(neighbours=2), "neighbours = 2: expected"),
        (lambda: Config.from_dict([1]), "expected keys and values, got a list"),
        (lambda: Config.from_dict({1: 2}), "unknown key '1'"),
        (lambda: Config.from_dict({"normals": {None: 2}}), "unknown key 'normals.None'"),
        (lambda: Config().replace({"normals.neighbours": 1}), "normals.neighbours = 1: expected"),
        (lambda: Config().replace(normals=Normals()), "unknown key 'normals'"),
    ],
)
def test_python_calls_are_checked_as_well(make, says):
    with pytest.raises(ConfigError, match=says):
        make()


# --- files that are no configuration ---


def test_missing_file(tmp_path):
    error = refused(tmp_path / "none.yaml")
    assert error.message == "no such configuration file"
    assert str(error.path).endswith("none.yaml")
    assert "dlogen config show" in error.hint


def test_folder(tmp_path):
    assert "folder" in refused(tmp_path).message


def test_impossible_names():
    assert "cannot be read" in refused("a\0b").message
    assert "cannot be read" in refused("x" * 5000).message


def test_not_utf8(write):
    assert refused(write(b"r: 0.02\n# \xff\n")).message == "line 2: not UTF-8 text"
    assert "not UTF-8" in refused(write("r: 0.02\n".encode("utf-16"))).message


def test_a_cloud_by_mistake(write):
    assert "not a configuration" in refused(write(b"ply\n" + b"0 0 0\n" * 100_000)).message
    assert "expected keys and values" in refused(write(b"ply\nformat ascii 1.0\nelement vertex 1\n")).message
    assert "U+0000" in refused(write(b"a: 1\nb: \0\1\2")).message


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /dev/zero")
def test_endless_file():
    assert "larger than" in refused("/dev/zero").message


# --- properties ---


def _values(setting) -> st.SearchStrategy:
    """Values that a setting allows."""
    if setting.kind == "flag":
        return st.booleans()
    if setting.kind == "choice":
        return st.sampled_from(setting.choices)
    if setting.pattern:
        return st.from_regex(setting.pattern, fullmatch=True).filter(lambda text: len(text) <= setting.most)
    if setting.kind == "text":
        return st.text(min_size=1, max_size=100).filter(str.isprintable)
    low, high = setting.least or 0, setting.most if setting.most is not None else 1e300
    if setting.kind == "integer":
        numbers = st.integers(int(low), int(min(high, 2**53)))
    else:
        numbers = st.floats(low, high, exclude_min=setting.above is not None)
    return numbers | st.just(AUTO) if setting.auto else numbers


@st.composite
def valid(draw) -> dict:
    """Nested data with some keys that contradict nothing."""
    chosen = draw(st.lists(st.sampled_from(sorted(KEYS.settings)), unique=True))
    data: dict = {}
    for key in chosen:
        section, _, name = key.rpartition(".")
        (data.setdefault(section, {}) if section else data)[name] = draw(_values(KEYS.settings[key]))
    if data.get("units") in ("mm", "cm"):
        del data["units"]
    if data.get("r", AUTO) != AUTO:
        data.pop("r_n", None)
    material = data.get("material", {})
    for name in ("mass", "mass_per_length", "wall_thickness", "shear_modulus"):
        material.pop(name, None)
    if isinstance(material.get("inner_radius"), float) and isinstance(data.get("r"), float):
        del material["inner_radius"]
    if AUTO in (material.get("youngs_modulus", AUTO), material.get("poissons_ratio", AUTO)):
        for name in ("youngs_modulus", "poissons_ratio", "damping_ratio"):
            material.pop(name, None)
    if "radius" in data.get("normals", {}):
        data["normals"].pop("neighbours", None)
    segmentation = data.get("segmentation", {})
    rules = ("criterion", "placement", "segments", "segment_length", "curvature_max", "min_bend_radius")
    for name in [name for name in rules if name in segmentation][1:]:
        del segmentation[name]
    if segmentation.get("placement") == "minimax":
        data.pop("profile", None)
    return data


_ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | st.sampled_from([AUTO, "paper", "mm", 0.02, 21]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text() | st.integers(), inner, max_size=3),
    max_leaves=5,
)
_NAMES = st.sampled_from([*KEYS.of_section(""), *KEYS.sections, "β", "radius", "neighbours", "enabled", "density"])


@given(valid())
def test_round_trip_through_data_and_yaml(tmp_path_factory, data):
    config = Config.from_dict(data)
    assert Config.from_dict(config.to_dict()) == config
    path = tmp_path_factory.mktemp("config") / "c.yaml"
    path.write_text(to_yaml(config), encoding="utf-8")
    assert load_config(path) == config


@given(valid())
def test_yaml_means_the_same_to_other_readers(data):
    yaml = pytest.importorskip("yaml")
    config = Config.from_dict(data)
    assert yaml.safe_load(to_yaml(config)) == config.to_dict()


@given(valid())
def test_what_loads_is_valid_by_the_schema(data):
    Draft202012Validator(json_schema()).validate(data)
    Draft202012Validator(json_schema()).validate(Config.from_dict(data).to_dict())


@settings(deadline=None)
@given(st.dictionaries(_NAMES | st.text(), _ANYTHING | st.dictionaries(_NAMES | st.text(), _ANYTHING, max_size=3)))
def test_any_mapping_loads_or_is_refused_in_words(data):
    try:
        config = Config.from_dict(data)
    except ConfigError as error:
        assert error.hint
        error.message.encode()
        return
    assert Config.from_dict(config.to_dict()) == config


@given(st.sampled_from(sorted(KEYS.settings)), _ANYTHING)
def test_schema_and_checks_agree_on_single_values(key, value):
    section, _, name = key.rpartition(".")
    data = {section: {name: value}} if section else {name: value}
    if section == "material" and name != "preset":
        data[section]["preset"] = "rope"  # some keys of the material say nothing alone
    if isinstance(value, float) and not math.isfinite(value):
        return  # JSON has no such numbers
    try:
        Config.from_dict(data)
        loads = True
    except ConfigError:
        loads = False
    printable = not isinstance(value, str) or value.isprintable()
    assert Draft202012Validator(json_schema()).is_valid(data) == loads or not printable
