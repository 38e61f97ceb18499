"""What a key may hold, and the messages for what it may not."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from configurations import refused

from dlogen.config.reader import load_config
from dlogen.config.schema import Config
from dlogen.errors import ConfigError


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
        (
            "bridge: everything",
            "bridge = 'everything': expected a number > 0 (m), all (every gap), or auto",
            "Gaps up to",
        ),
        ("bridge: 0", "bridge = 0: expected a number > 0 (m), all (every gap), or auto", "Gaps up to"),
        ("bridge: 20 mm", "bridge = '20 mm': expected", "lengths are metres, without a unit: 0.02"),
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


def test_numbers_are_stored_with_the_type_of_their_field(write):
    config = load_config(write("r: 1\nN: 21.0\nmdtw: {samples: 1e3}\n"))
    assert (config.r, config.N, config.mdtw.samples) == (1.0, 21, 1000)
    assert [type(value) for value in (config.r, config.N, config.mdtw.samples)] == [float, int, int]


def test_numbers_of_other_libraries(write):
    config = Config(r=np.float64(0.02), N=np.int64(21), beta=Fraction(1, 100))
    assert [type(value) for value in (config.r, config.N, config.beta)] == [float, int, float]


@pytest.mark.parametrize("value", [2**2000, Fraction(10) ** 400])
def test_numbers_beyond_floats(value):
    with pytest.raises(ConfigError) as caught:
        Config.from_dict({"r": value})
    assert caught.value.hint == "it must be finite"


def test_010_is_ten(write):
    assert load_config(write("N: 010\n")).N == 10


def test_a_word_in_place_of_a_length(write):
    assert load_config(write("bridge: all\n")).bridge == "all"
    assert load_config(write("bridge: auto\n")).bridge == "auto"
    bridge = load_config(write("bridge: 1\n")).bridge
    assert bridge == 1.0 and isinstance(bridge, float)
    # Where words are not declared, they are none.
    assert "expected a number > 0 (m), or auto" in refused(write("length: all\n")).message
