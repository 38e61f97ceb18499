"""All that is wrong is named at once."""

from __future__ import annotations

import pytest
from configurations import refused

from dlogen.config.problems import Problem, refuse, show
from dlogen.errors import ConfigError


def test_all_that_is_wrong_with_a_file_is_named_at_once_in_its_order(write):
    error = refused(write("r: x\nemax: 1\nnormals:\n  neighbours: 1\nN: 21\nN: 22\nseed: 1\n"))
    lines = error.message.splitlines()
    assert lines[0] == "4 problems:"
    assert [line.split(":")[0].strip() for line in lines[1:]] == ["line 1", "line 2", "line 4", "line 6"]
    assert "(did you mean 'e_max'?)" in lines[2]
    assert str(error).startswith(f"{error.path}: 4 problems:")


def test_all_that_is_wrong_with_overrides_is_named_at_once():
    error = refused(None, ["r=x", "emax=1", "N=30"])
    assert error.message.startswith("2 problems:\n  --set r=x: ")
    assert error.path is None


def test_one_problem_is_the_error_itself():
    with pytest.raises(ConfigError) as caught:
        refuse([Problem("line 3", "this is wrong", "do that")], "cfg.yaml")
    assert (caught.value.message, caught.value.hint) == ("line 3: this is wrong", "do that")
    assert caught.value.path == "cfg.yaml"
    refuse([])


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "nothing"),
        (False, "false"),
        ({"a": 1}, "a section"),
        ((1, 2), "a list"),
        (10**31, "a very large number"),
        (-(10**30), "-1000000000000000000000000000000"),
        ("a\x1b[31m", r"'a\x1b[31m'"),
        ("x" * 58, f"'{'x' * 58}'"),
        ("x" * 59, f"'{'x' * 56}..."),
    ],
)
def test_values_are_shown_short_and_printable(value, shown):
    assert show(value) == shown
    assert len(show(value)) <= 60
