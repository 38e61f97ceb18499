"""`dlogen compare`: the error between two curves or chains."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command
from dlogen.config.defaults import MDTW_SAMPLES

if TYPE_CHECKING:
    from dlogen.io.curves.curve import Curve

#: Lengths that differ by more than this factor are a matter of units.
_UNLIKE = 20.0

_EXAMPLES = """Examples:

\b
  dlogen compare cloud.json cloud.truth.json
  dlogen compare cloud.urdf cloud.json#skeleton --json | jq .mean
  dlogen compare measured.csv cloud.json --fail-above 0.005 && echo good enough
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("a")
@click.argument("b")
@click.option(
    "--samples",
    type=click.IntRange(2, 20_000),
    default=MDTW_SAMPLES,
    show_default=True,
    help="Points on each curve, even in arc length.",
)
@click.option(
    "--align-direction/--keep-direction",
    default=True,
    show_default=True,
    help="Take B in the direction that fits A better, or as it is.",
)
@click.option("--fail-above", type=float, metavar="METRES", help="Exit 1 when the largest MDTW error is above this.")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON, lengths in metres, with the error along A.")
def command(
    a: str, b: str, samples: int, align_direction: bool, fail_above: float | None, as_json: bool, console: Console
) -> None:
    """Measure the MDTW error between the curves A and B (- for stdin).

    Each is a chain JSON (its joints; FILE#skeleton for the skeleton line), a URDF of one serial chain, a CSV or PLY
    polyline in metres, or the truth of a synthetic cloud.
    """
    from dlogen.errors import DlogenError, UsageError
    from dlogen.evaluation.comparison import compare
    from dlogen.io.curves.curve import load_curve

    if fail_above is not None and not 0.0 <= fail_above < math.inf:
        raise UsageError(f"--fail-above {fail_above} is not a length", "give metres, 0 or more")
    if a.partition("#")[0] == b.partition("#")[0] == "-":
        raise UsageError("both curves cannot come from stdin", "name a file for one of them")
    curves = load_curve(a), load_curve(b)
    lengths = sorted(curve.length for curve in curves)
    if lengths[1] > _UNLIKE * lengths[0]:
        console.warning(
            f"one curve is {lengths[1] / lengths[0]:.4g} times as long as the other: both have to be in metres"
        )
    found = compare(curves[0].points, curves[1].points, samples, align_direction=align_direction)
    if as_json:
        names = {key: _about(curve) for key, curve in zip("ab", curves, strict=True)}
        print_json({"schema": "dlogen.compare/1", "units": {"length": "m"}, **names, **found})
    else:
        for label, text in _rows(curves, found):
            click.echo(f"{label:<18} {text}")
    if fail_above is not None and found["max"] > fail_above:
        raise DlogenError(
            f"the largest error is {1e3 * found['max']:.3f} mm, above the {1e3 * fail_above:.3f} mm allowed",
            "the output says where along A; --samples and --keep-direction change what is compared",
        )


def _about(curve: Curve) -> dict[str, Any]:
    return {"name": curve.name, "kind": curve.kind, "vertices": len(curve.points)}


def _rows(curves: tuple[Curve, Curve], found: dict[str, Any]) -> list[tuple[str, str]]:
    """The outcome for people, in millimetres."""
    texts = [f"{curve.name} ({curve.kind}, {len(curve.points)} vertices)" for curve in curves]
    s = found["s"][found["error"].index(found["max"])]
    share = 100.0 * found["length_difference"] / found["length_b"]
    return [
        ("A", texts[0]),
        ("B", texts[1] + (", taken from its end to its start" if found["reversed"] else "")),
        ("sampling", f"{found['samples']} points on each, {found['sampling']}"),
        ("MDTW mean", _mm(found["mean"])),
        ("MDTW std", _mm(found["std"])),
        ("MDTW max", f"{_mm(found['max'])} at s = {s:.3f} of A"),
        ("warping path", f"{found['path_length']:>12} pairs"),
        ("Hausdorff distance", _mm(found["hausdorff"])),
        ("length of A", _mm(found["length_a"])),
        ("length of B", _mm(found["length_b"])),
        ("A less B", f"{_mm(found['length_difference'])} ({share:+.2f} %)"),
    ]


def _mm(metres: float) -> str:
    return f"{1e3 * metres:12.3f} mm"
