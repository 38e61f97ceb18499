"""The resolved configuration of a result, as plain settings."""

from __future__ import annotations

from dataclasses import replace


def test_settings_are_those_of_the_configuration(make_result, straight) -> None:
    result = make_result(straight([0, 0, 0], [1, 0, 0]), 0.01)
    assert result.settings == result.config.to_dict()
    other = replace(result, config=result.config.resolved({"r": 0.0125}))
    assert other.settings["r"] == 0.0125 != result.settings["r"]
