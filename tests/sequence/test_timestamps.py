"""Times of captures: lists, names, rates."""

from __future__ import annotations

import pytest

from dlogen.errors import UsageError
from dlogen.sequence.timestamps import capture_times


def test_a_list_has_the_last_word() -> None:
    times = capture_times(["b_2", "a_1", "c_3"], [0.5, 0.25, 1.75])
    assert times.order == (1, 0, 2)
    assert times.seconds == (0.25, 0.5, 1.75)
    assert times.source == "list" and not times.assumed


def test_capture_numbers_at_a_rate_with_a_gap() -> None:
    times = capture_times(["frame_10", "frame_2", "frame_3"], rate=20.0)
    assert times.order == (1, 2, 0)
    assert times.seconds == pytest.approx((0.0, 0.05, 0.4), abs=1e-15)
    assert times.source == "numbers" and not times.assumed


def test_without_a_rate_a_capture_a_second() -> None:
    times = capture_times(["f_005", "f_006"])
    assert times.seconds == (0.0, 1.0) and times.assumed


@pytest.mark.parametrize(
    ("names", "seconds"),
    [
        (["t1.25", "t0.5"], (0.5, 1.25)),
        (["1700000000", "1700000001"], (1.7e9, 1.7e9 + 1)),
        (["c-1700000000250", "c-1700000000500"], (1.7e9 + 0.25, 1.7e9 + 0.5)),
        (["1700000000250000", "1700000000250033"], (1.7e9 + 0.25, 1.7e9 + 0.250033)),
        (["x1700000000250000000", "x1700000000500000000"], (1.7e9 + 0.25, 1.7e9 + 0.5)),
        (["1700000000_250000000", "1700000000_500000000"], (1.7e9 + 0.25, 1.7e9 + 0.5)),
        (["1700000000.25", "1700000000.5"], (1.7e9 + 0.25, 1.7e9 + 0.5)),
        # Folders and what stands before the last number do not count.
        (["run_9.5/hose2_0.5", "run_1.5/hose2_0.75"], (0.5, 0.75)),
    ],
)
def test_times_in_names(names: list[str], seconds: tuple[float, ...]) -> None:
    times = capture_times(names)
    assert times.seconds == pytest.approx(seconds, abs=1e-6)
    assert times.source == "names" and not times.assumed


def test_padded_numbers_are_numbers_of_captures() -> None:
    assert capture_times(["0000000000017", "0000000000018"], rate=2.0).seconds == (0.0, 0.5)


def test_rates_do_not_round() -> None:
    times = capture_times([f"f{k}" for k in range(1000)], rate=30.0)
    assert times.seconds[999] == 999 / 30


def test_names_without_numbers_in_their_order() -> None:
    times = capture_times(["b", "a10", "a2"], rate=10.0)
    assert times.order == (2, 1, 0)
    assert times.seconds == pytest.approx((0.0, 0.1, 0.2))
    assert times.source == "order"


@pytest.mark.parametrize(
    ("names", "listed", "rate", "message"),
    [
        (["a", "b"], [1.0, 1.0], None, "a and b have the same time"),
        (["x/f_1", "y/f_1"], [None, None], None, "x/f_1 and y/f_1 have the same time"),
        (["a", "b"], [1.0, None], None, "b has no time"),
        (["a", "b"], [1.0, 2.0], 30.0, "--rate"),
        (["a0.5", "a0.7"], [None, None], 30.0, "--rate"),
        (["f_12", "f_0.5"], [None, None], None, "not of one kind"),
        (["f_12", "f_1700000000250"], [None, None], None, "frame numbers and milliseconds"),
        # Nearer than a float can tell.
        (["1700000000000000001", "1700000000000000002"], [None, None], None, "the same time"),
    ],
)
def test_what_cannot_be(names: list[str], listed: list[float | None], rate: float | None, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        capture_times(names, listed, rate)


def test_one_capture() -> None:
    assert capture_times(["frame_7"], rate=30.0).seconds == (0.0,)
