"""Configurations for tests: random ones that are valid, and how one is refused."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import strategies as st

from dlogen.config.fields import AUTO, Setting
from dlogen.config.reader import load_config
from dlogen.config.schema import config_keys
from dlogen.errors import ConfigError

KEYS = config_keys()

#: What a file may hold in place of a value.
ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | st.sampled_from([AUTO, "paper", "mm", 0.02, 21]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text() | st.integers(), inner, max_size=3),
    max_leaves=5,
)
#: Keys, sections, and words that resemble them.
NAMES = st.sampled_from([*KEYS.of_section(""), *KEYS.sections, "β", "radius", "neighbours", "enabled", "density"])


def refused(*args: Any, **kwargs: Any) -> ConfigError:
    """The error with which `load_config` refuses this; it says what is wrong and what to do."""
    with pytest.raises(ConfigError) as caught:
        load_config(*args, **kwargs)
    error = caught.value
    assert error.exit_code == 2
    assert error.message
    assert error.hint
    return error


def _values(setting: Setting) -> st.SearchStrategy:
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
def valid(draw: st.DrawFn) -> dict[str, Any]:
    """Nested data with some keys that contradict nothing."""
    chosen = draw(st.lists(st.sampled_from(sorted(KEYS.settings)), unique=True))
    data: dict[str, Any] = {}
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
