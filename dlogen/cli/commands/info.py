"""`dlogen info`: a look at a cloud before fitting."""

from __future__ import annotations

from typing import Any

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command
from dlogen.cli.options import units_option
from dlogen.config.defaults import R_PER_E_MAX

_EXAMPLES = """Examples:

\b
  dlogen info cloud.ply
  dlogen info scan.pcd --units mm --json | jq .chosen.r
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("cloud", type=click.Path(allow_dash=True))
@units_option("What the cloud's numbers are; auto guesses.", "auto")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON, lengths in metres.")
def command(cloud: str, units: str, as_json: bool, console: Console) -> None:
    """Show what is in CLOUD (- for stdin) and which parameters fit it."""
    from dlogen.inspect import inspect
    from dlogen.io.cloud_files import read_cloud

    found = inspect(read_cloud(cloud), units)
    if as_json:
        print_json(found)
        return
    for key, value in _rows(found):
        click.echo(f"{key:<22} {value}")


def _rows(found: dict[str, Any]) -> list[tuple[str, str]]:
    """What people want to see of it, lengths in the unit that reads well."""
    dropped, units = found["dropped"], found["units"]
    rows = [
        ("format", f"{found['format']} {found['encoding']}"),
        ("fields", " ".join(found["fields"])),
        ("points", f"{found['points']} of {found['declared_points']}"),
        ("dropped", f"{dropped['non_finite']} not finite, {dropped['duplicates']} duplicates"),
        *([("very far away", f"{found['far_away']} (left out)")] if found["far_away"] else []),
        *([] if found["mesh"] is None else [("mesh", _mesh(**found["mesh"]))]),
        ("organised", "no" if found["organised"] is None else "{} x {} pixels".format(*found["organised"])),
        ("normals stored", "yes" if found["normals"] else "no"),
        ("viewpoint", "none" if found["viewpoint"] is None else _vector(found["viewpoint"])),
        ("units", _units(units["used"], units["guess"], units["given"])),
        ("extent", _vector(found["extent"])),
        ("from", _vector(found["minimum"])),
        ("to", _vector(found["maximum"])),
    ]
    if found["few_digits"] is not None:
        rows.append(("digits", found["few_digits"]))
    if found["problem"] is not None:
        return [*rows, ("cannot be fitted", found["problem"])]
    if found["nodes"]:
        return [*rows, ("nodes", "the points lie on a line and show no width: a fit needs --set r=... (metres)")]
    scale, chosen = found["scale"], found["chosen"]
    sure = "" if scale["radius_reliable"] else " (not sure: the cross-sections do not agree on one)"
    return [
        *rows,
        ("spacing", f"{1e3 * scale['spacing']:.3g} mm between nearest points"),
        ("r", f"{1e3 * chosen['r']:.4g} mm{sure}"),
        ("r_n", f"{1e3 * chosen['r_n']:.4g} mm"),
        ("e_max", f"{1e3 * chosen['e_max']:.4g} mm (r / {R_PER_E_MAX})"),
        ("N", str(chosen["N"])),
        ("normals.neighbours", str(chosen["normals.neighbours"])),
    ]


def _mesh(triangles: int, sampled: int) -> str:
    """Its size, and what a fit makes of it."""
    if sampled:
        return (
            f"{triangles} triangles; a fit spreads {sampled} points over them (--set mesh=vertices: uses the vertices)"
        )
    return f"{triangles} triangles; a fit uses the vertices (--set mesh=sample: points spread over the triangles)"


def _units(used: str, guess: str, given: bool) -> str:
    """The units, and what follows from them for a fit."""
    if used != guess:
        return f"{used} (looks like {guess})"
    # A fit takes numbers for metres unless told otherwise.
    return used if given or used == "m" else f"{used} (a guess; fit with --set units={used})"


def _vector(values: list[float]) -> str:
    return "  ".join(f"{value:.6g}" for value in values) + " m"
