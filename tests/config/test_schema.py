"""What a configuration is: defaults, checks of Python calls, changes."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from configurations import ANYTHING, KEYS, NAMES
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.config.fields import AUTO
from dlogen.config.reader import load_config
from dlogen.config.schema import Config
from dlogen.config.sections import JointSettings, Material, Normals, Segmentation
from dlogen.errors import ConfigError


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


def test_replace():
    config = Config(r=0.02).replace({"normals.neighbours": 20}, e_max=0.005)
    assert (config.r, config.e_max, config.normals.neighbours) == (0.02, 0.005, 20)
    assert config.replace(r=AUTO).r == AUTO
    with pytest.raises(ConfigError, match="unknown key 'emax'"):
        config.replace(emax=1)
    with pytest.raises(ConfigError, match="is less than the diameter"):
        config.replace(r_n=0.03)


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


@settings(deadline=None)
@given(st.dictionaries(NAMES | st.text(), ANYTHING | st.dictionaries(NAMES | st.text(), ANYTHING, max_size=3)))
def test_any_mapping_loads_or_is_refused_in_words(data):
    try:
        config = Config.from_dict(data)
    except ConfigError as error:
        assert error.hint
        error.message.encode()
        return
    assert Config.from_dict(config.to_dict()) == config
