"""What is written for a cloud."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from dlogen.errors import UsageError
from dlogen.io.outputs import Outputs
from dlogen.io.registry import model_formats
from dlogen.types import FitData


def test_names_as_on_the_command_line() -> None:
    assert Outputs.parse("urdf, json,urdf,") == Outputs(("urdf", "json"))
    assert Outputs.parse("all", plot=True).formats == tuple(item.name for item in model_formats())
    with pytest.raises(UsageError, match="unknown model format 'udrf'") as raised:
        Outputs.parse("json,udrf")
    assert raised.value.hint == "did you mean 'urdf'?"


@pytest.mark.parametrize("nothing", ["", " , "])
def test_no_format_at_all(nothing: str) -> None:
    with pytest.raises(UsageError, match="no model format") as raised:
        Outputs.parse(nothing)
    assert "urdf" in str(raised.value.hint)


def test_names_for_the_records_and_back() -> None:
    for outputs in (Outputs(), Outputs(("mjcf",), plot=True), Outputs((), plot=True), Outputs(())):
        assert Outputs.of(outputs.names) == outputs
        # The records have blanks between them.
        assert not any(" " in name for name in outputs.names)
    assert "plot" not in {item.name for item in model_formats()}


def test_files_are_known_before_there_is_anything_to_write(
    make_result: Callable[..., FitData], circle: Callable[..., Any], fitted: Callable[..., Any]
) -> None:
    result = make_result(fitted(circle(0.5, 2.0)), name="hose")
    outputs = Outputs.parse("all", plot=True)
    contents = outputs.contents(result, "hose", {"schema": "x"})
    assert set(contents) == set(outputs.files("hose"))
    assert contents["hose.report.json"] == b'{\n  "schema": "x"\n}\n'
    assert contents["hose.png"].startswith(b"\x89PNG")
