"""`dlogen eval`: the paper's tables, for a user's CI."""

from __future__ import annotations

import click

from dlogen.cli import Command
from dlogen.console import Console, print_json

_EXAMPLES = """Examples:

\b
  dlogen eval
  dlogen eval --table II --seeds 3
  dlogen eval --json > tables.json
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.option("--table", "tables", type=click.Choice(["II", "III"]), multiple=True, help="Only this table; repeatable.")
@click.option("--seeds", type=click.IntRange(1, 1000), default=10, show_default=True, help="Clouds a curve (Table II).")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="The first seed.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def command(tables: tuple[str, ...], seeds: int, seed: int, as_json: bool, console: Console) -> None:
    """Measure the paper's Tables II and III again, on synthetic clouds, beside the paper's figures.

    Exits with 1 when a figure is outside its bound.
    """
    from dlogen.errors import DlogenError
    from dlogen.evaluation import table_2, table_3

    figures = []
    if not tables or "II" in tables:
        with console.status("Table II"):
            figures += list(table_2(seeds, seed))
    if not tables or "III" in tables:
        with console.status("Table III"):
            figures += list(table_3(seed))
    if as_json:
        print_json(
            {
                "schema": "dlogen.evaluation/1",
                "ok": all(figure.ok for figure in figures),
                "figures": [figure.to_dict() for figure in figures],
            }
        )
    else:
        click.echo(f"{'table':<6}{'row':<10}{'quantity':<44}{'paper':>8}{'dlogen':>9}  {'bound':<16}")
        for figure in figures:
            click.echo(
                f"{figure.table:<6}{figure.row:<10}{figure.quantity:<44}{_number(figure.paper):>8}"
                f"{_number(figure.measured):>9}  {_bound(figure.low, figure.high, figure.unit):<16}"
                f"{'' if figure.ok else '  WORSE'}".rstrip()
            )
    worse = [f"{figure.row} {figure.quantity}" for figure in figures if not figure.ok]
    if worse:
        raise DlogenError(
            f"outside the bound: {', '.join(worse)}", "a change made the fit worse, or the bound is wrong"
        )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _bound(low: float | None, high: float | None, unit: str) -> str:
    if low is not None and high is not None:
        return f"{low:.4g} .. {high:.4g} {unit}".rstrip()
    return f"<= {high:.4g} {unit}".rstrip() if high is not None else unit
