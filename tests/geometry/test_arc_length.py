from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlogen.evaluation.shapes import centre_line, random_centre_line
from dlogen.geometry.arc_length import arc_length, arc_length_table, cells, even_parameters, interpolated


def test_lengths_of_known_curves(circle, helix, straight) -> None:
    assert arc_length(circle(0.3, 5.0)) == pytest.approx(1.5, rel=1e-12)
    assert arc_length(helix(0.3, 0.4, 7.0)) == pytest.approx(0.5 * 7, rel=1e-12)
    assert arc_length(straight([1, 2, 3], [1, 2, 5.5])) == pytest.approx(2.5, rel=1e-12)


def test_length_of_an_ellipse_at_uneven_speed(exact_line) -> None:
    # `bent` is half an ellipse with the half axes 1 and 2; its length by the complete elliptic integral.
    from scipy.special import ellipe

    assert arc_length(exact_line(centre_line("bent"))) == pytest.approx(2 * 2 * ellipe(1 - 1 / 4), rel=1e-12)


def test_table_grows_from_zero_to_the_length(exact_line) -> None:
    line = exact_line(centre_line("bent"))
    s, length = arc_length_table(line, 64)
    assert s[0] == length[0] == 0.0
    assert s[-1] == 1.0
    assert length[-1] == pytest.approx(line.length, rel=1e-12)
    assert (np.diff(length) > 0).all()
    # Half of a curve that is symmetric about its middle.
    assert length[32] == pytest.approx(line.length / 2, rel=1e-12)


@pytest.mark.parametrize("count", [2, 3, 1000])
def test_even_parameters_are_even_in_arc_length(exact_line, count: int) -> None:
    line = exact_line(centre_line("bent"))
    s = even_parameters(line, count)
    assert len(s) == count
    assert s[0] == 0.0
    assert s[-1] == 1.0
    truth = centre_line("bent").parameter(np.linspace(0, 1, count))
    assert s == pytest.approx(truth, abs=1e-9)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.floats(0.3, 3.0))
def test_even_parameters_with_an_uneven_parameter(exact_line, seed: int, bend: float) -> None:
    smooth = random_centre_line(seed)

    def curve(s, derivative):  # the same curve run through at a speed that doubles (and more)
        t = s + bend / 4 * s * (s - 1)
        speed = 1 + bend / 4 * (2 * s - 1)
        return smooth.curve(t, 0) if derivative == 0 else smooth.curve(t, 1) * speed[:, None]

    line = exact_line(curve)
    assert line.length == pytest.approx(smooth.length, rel=1e-9)
    s = even_parameters(line, 257)
    assert (np.diff(s) > 0).all()
    assert line(s) == pytest.approx(smooth.points(257), abs=1e-9)


def test_a_curve_without_length_and_one_with_a_cusp(exact_line, straight) -> None:
    still = straight([1, 2, 3], [1, 2, 3])
    assert arc_length(still) == 0.0
    assert even_parameters(still, 5) == pytest.approx(np.linspace(0, 1, 5))

    def cusp(s, derivative):  # (t^3, t^2): at rest in t = 0
        t = 2 * s - 1
        x, y = ((t**3, t**2), (6 * t**2, 4 * t))[derivative]
        return np.stack([x, y, np.zeros_like(t)], axis=-1)

    s = even_parameters(exact_line(cusp), 501)
    assert (np.diff(s) > 0).all()
    t = 2 * s - 1
    along = np.sign(t) * ((4 + 9 * t**2) ** 1.5 - 8) / 27
    assert along == pytest.approx(np.linspace(along[0], along[-1], 501), abs=1e-7)


def test_cells_of_a_table_by_hand() -> None:
    length = np.array([0.0, 1.0, 1.0, 3.0])
    k, width, t = cells(length, np.array([0.0, 0.5, 1.0, 2.5, 3.0]))
    # The cell without width is passed over; the end belongs to the last cell.
    assert k.tolist() == [0, 0, 2, 2, 2]
    assert width.tolist() == [1.0, 1.0, 2.0, 2.0, 2.0]
    assert t.tolist() == [0.0, 0.5, 0.0, 0.75, 1.0]


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_interpolation_inverts_what_is_a_cubic_and_keeps_to_its_cell(places: list[float]) -> None:
    # s(l) = l^3 + l, a cubic, comes back to rounding from its values and slopes.
    length = np.array([0.0, 0.3, 0.45, 1.0])
    at = np.array(places)
    found = interpolated(length**3 + length, 3 * length**2 + 1, *cells(length, at))
    assert found == pytest.approx(at**3 + at, abs=1e-15)
    # Slopes that no monotonous curve has.
    wild = interpolated(length, np.full(4, 50.0), *cells(length, at))
    k = cells(length, at)[0]
    assert ((wild >= length[k]) & (wild <= length[k + 1])).all()
