"""When each capture of a recording was taken: by a list, by the names of the files, or by their rate."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from dlogen.errors import UsageError

#: Names such as 1700000000_123456789: seconds and nanoseconds.
_SECONDS_AND_NANOSECONDS = re.compile(r"(?<!\d)(\d{9,10})[_-](\d{9})(?!\d)")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")

#: Whole numbers from here on are times since 1970 in these units of a second: those of dates after 2001.
_STAMPS = ((10**18, 10**9, "nanoseconds"), (10**15, 10**6, "microseconds"), (10**12, 10**3, "milliseconds"))
_SECONDS = 10**9


@dataclass(frozen=True)
class Times:
    """When captures were taken.

    Attributes:
        order: indices of the captures in the order of time.
        seconds: of the captures in that order, increasing.
        source: "list", "names", "numbers" (of the names, at a rate) or "order" (of the names, at a rate).
        assumed: whether a rate of one capture a second was assumed.
    """

    order: tuple[int, ...]
    seconds: tuple[float, ...]
    source: str
    assumed: bool = False


def capture_times(names: Sequence[str], listed: Sequence[float | None] = (), rate: float | None = None) -> Times:
    """Times of captures.

    - Where a list has a column `time`, that is it.
    - Otherwise the last number of each name: with a decimal point it is seconds; so large that it is a date after 2001,
      it is seconds, milliseconds, microseconds or nanoseconds since 1970; otherwise it is the capture's number, and the
      rate makes seconds of it, from the first capture on. A number that is missing is a gap.
    - Names without numbers are put in order (2 before 10) and follow one another at the rate.

    Args:
        names: of the captures, without endings.
        listed: seconds by a list, or None.
        rate: captures a second; 1 is assumed where it is needed.

    Raises:
        UsageError: two captures have the same time; only some have one; or there are times, and a rate as well.
    """
    if any(time is not None for time in listed):
        missing = [name for name, time in zip(names, listed, strict=True) if time is None]
        if missing:
            raise UsageError(
                f"{missing[0]} has no time, other frames have one in the list", "fill the column time in every row"
            )
        times, source = [Fraction(time) for time in listed if time is not None], "list"
    else:
        found = [_number(name) for name in names]
        kinds = {kind for _, kind in found}
        if None in kinds:
            natural = sorted(range(len(names)), key=lambda i: (_natural(names[i]), names[i]))
            times, source = [Fraction(natural.index(i)) for i in range(len(names))], "order"
        elif len(kinds) > 1:
            one, other = sorted(str(kind) for kind in kinds)[:2]
            examples = [names[[kind for _, kind in found].index(kind)] for kind in (one, other)]
            raise UsageError(
                f"the numbers in the names {' and '.join(examples)} are not of one kind: {one} and {other}",
                "name the frames alike, or give a list @FRAMES.csv with the columns cloud and time",
            )
        else:
            times = [number for number, _ in found]
            source = "numbers" if kinds == {"frame numbers"} else "names"
    if rate is not None and source in ("list", "names"):
        where = "the list has" if source == "list" else "the names of the frames have"
        raise UsageError(f"--rate was given, but {where} times", "leave --rate away, or rename the frames")
    if source in ("numbers", "order") and times:
        first = min(times)
        times = [(time - first) / Fraction(rate or 1) for time in times]
    order = sorted(range(len(names)), key=lambda i: times[i])
    seconds = [float(times[i]) for i in order]
    for k in range(1, len(order)):
        if seconds[k] <= seconds[k - 1]:
            raise UsageError(
                f"the frames {names[order[k - 1]]} and {names[order[k]]} have the same time, {seconds[k]:.9g} s",
                "the last number of a name is taken for its time; give a list @FRAMES.csv with the columns cloud and "
                "time instead",
            )
    return Times(tuple(order), tuple(seconds), source, source in ("numbers", "order") and rate is None)


def _number(name: str) -> tuple[Fraction, str | None]:
    """The last number of a name, without its folders, and what it is; of times in seconds."""
    name = name.rpartition("/")[2]
    split = list(_SECONDS_AND_NANOSECONDS.finditer(name))
    numbers = _NUMBER.findall(name)
    if split and split[-1].end() == len(name.rstrip()):
        return int(split[-1][1]) + Fraction(int(split[-1][2]), 10**9), "seconds"
    if not numbers:
        return Fraction(0), None
    value = Fraction(numbers[-1])
    if "." in numbers[-1]:
        return value, "seconds"
    for least, unit, kind in _STAMPS:
        if value >= least:
            return value / unit, kind
    return value, "seconds" if value >= _SECONDS else "frame numbers"


def _natural(name: str) -> list[tuple[int, str]]:
    """For sorting: numbers by their value."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
