"""What captures have in common, and which are excluded by their sizes."""

from __future__ import annotations

import numpy as np
import pytest

from dlogen.sequence.captures import CaptureFit
from dlogen.sequence.outliers import common_sizes, exclusion_by_size

POINTS = np.zeros((2, 3))


def captures_of(lengths, radii=None, residuals=None) -> list[CaptureFit]:
    radii = [0.01] * len(lengths) if radii is None else radii
    residuals = [0.001] * len(lengths) if residuals is None else residuals
    return [CaptureFit("x", POINTS, *values) for values in zip(lengths, radii, residuals, strict=True)]


def sizes_of(captures):
    return common_sizes(captures, np.ones(len(captures), dtype=bool))


def test_medians_and_robust_spreads() -> None:
    rng = np.random.default_rng(0)
    lengths = 1.0 + 0.004 * rng.normal(size=501)
    lengths[:100] = 0.3
    sizes = sizes_of(captures_of(lengths))
    assert sizes.length.value == pytest.approx(1.0, abs=2e-3)
    assert 0.004 < sizes.length.spread < 0.008
    assert sizes.length.allowed == pytest.approx(6 * sizes.length.spread)


def test_what_does_no_harm_is_allowed() -> None:
    sizes = sizes_of(captures_of([1.0] * 9))
    assert sizes.length.allowed == pytest.approx(0.01)
    assert sizes.radius.allowed == pytest.approx(0.001)
    thick = sizes_of(captures_of([1.0] * 9, [0.05] * 9))
    assert thick.length.allowed == pytest.approx(0.05)


def test_never_another_object() -> None:
    rng = np.random.default_rng(1)
    sizes = sizes_of(captures_of(rng.uniform(0.5, 1.5, 50), rng.uniform(0.005, 0.02, 50)))
    assert sizes.length.allowed == pytest.approx(0.1 * sizes.length.value)
    assert sizes.radius.allowed == pytest.approx(0.5 * sizes.radius.value)


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ((1.005, 0.0101, 0.0015), None),
        ((0.95, 0.01, 0.001), "length"),
        ((1.05, 0.01, 0.001), "length"),
        ((1.0, 0.0115, 0.001), "radius"),
        ((1.0, 0.01, 0.0031), "noise"),
        ((1.0, 0.01, 0.00001), None),
    ],
)
def test_exclusion_by_size(values, code) -> None:
    exclusion = exclusion_by_size(CaptureFit("x", POINTS, *values), sizes_of(captures_of([1.0] * 9)))
    assert (exclusion and exclusion.code) == code
    if exclusion is not None:
        assert "mm" in exclusion.message and "allowed" in exclusion.message


def test_captures_not_in_use_do_not_count() -> None:
    captures = captures_of([1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0])
    assert common_sizes(captures, np.arange(7) < 3).length.value == 1.0


@pytest.mark.parametrize("name", ["length", "radius"])
def test_two_objects_are_not_averaged(name: str) -> None:
    """The median of as many long as short ones is the size of none."""
    rng = np.random.default_rng(2)
    values = np.repeat([1.0, 1.25], 10) * (1.0 + 0.001 * rng.normal(size=20))
    captures = captures_of(values) if name == "length" else captures_of([1.0] * 20, 0.02 * values)
    sizes = sizes_of(captures)
    exclusions = [exclusion_by_size(item, sizes) for item in captures]
    codes = [exclusion.code if exclusion else None for exclusion in exclusions]
    assert codes in ([None] * 10 + [name] * 10, [name] * 10 + [None] * 10)
    assert getattr(sizes, name).agreed


def test_sizes_that_only_drift_are_not_agreed() -> None:
    assert not sizes_of(captures_of(np.linspace(0.6, 1.1, 40))).length.agreed
    assert sizes_of(captures_of(np.linspace(1.0, 1.02, 40))).length.agreed
    assert sizes_of(captures_of([1.0, 1.01])).length.agreed
    assert not sizes_of(captures_of([1.0, 1.1])).length.agreed
