"""`dlogen eval`: the paper's tables, for a user's CI."""

from __future__ import annotations

from pathlib import Path

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command

_EXAMPLES = """Examples:

\b
  dlogen eval
  dlogen eval --table II --seeds 3
  dlogen eval --json > tables.json
"""


TABLES = ("II", "III", "robustness")

#: Clouds a row that the bounds are meant for.
SEEDS = 10


@click.command(cls=Command, epilog=_EXAMPLES)
@click.option("--table", "tables", type=click.Choice(TABLES), multiple=True, help="Only this table; repeatable.")
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    default=SEEDS,
    show_default=True,
    help="Clouds a row (Table II and robustness).",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="The first seed.")
@click.option("--plot", "plot_folder", metavar="DIR", help="Write pictures of the tables (needs matplotlib).")
@click.option("--force", is_flag=True, help="Overwrite existing pictures.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def command(
    tables: tuple[str, ...],
    seeds: int,
    seed: int,
    plot_folder: str | None,
    force: bool,
    as_json: bool,
    console: Console,
) -> None:
    """Measure the paper's Tables II and III again, and how much the refined profile stands.

    The clouds are synthetic and their truth is known. Figures stand beside the paper's, where it has any. Exits with 1
    when a figure is outside its bound.
    """
    from dlogen.errors import DlogenError
    from dlogen.evaluation.paper_tables import table_2, table_3
    from dlogen.evaluation.robustness import robustness

    measure = {
        "II": lambda: table_2(seeds, seed),
        "III": lambda: table_3(seed),
        "robustness": lambda: robustness(seeds, seed),
    }
    figures = []
    for table in TABLES:
        if not tables or table in tables:
            with console.status(f"table {table}"):
                figures += list(measure[table]())
    if plot_folder is not None:
        from dlogen.evaluation.plots import evaluation_pictures
        from dlogen.io.atomic import refuse_existing, write_all

        pictures = {Path(plot_folder) / name: data for name, data in evaluation_pictures(figures).items()}
        refuse_existing(list(pictures), force)
        write_all(pictures)
    if as_json:
        rows = [figure.to_dict() for figure in figures]
        print_json({"schema": "dlogen.evaluation/1", "ok": all(figure.ok for figure in figures), "figures": rows})
    else:
        click.echo(f"{'table':<12}{'row':<36}{'quantity':<42}{'paper':>8}{'dlogen':>11}  bound")
        for figure in figures:
            click.echo(
                f"{figure.table:<12}{figure.row:<36}{figure.quantity:<42}{_number(figure.paper):>8}"
                f"{_number(figure.measured):>11}  {_bound(figure.low, figure.high, figure.unit)}"
                f"{'' if figure.ok else '  WORSE'}"
            )
    worse = [f"{figure.row} {figure.quantity}" for figure in figures if not figure.ok]
    if worse:
        raise DlogenError(
            f"outside the bound: {', '.join(worse)}",
            f"a change has made the fit worse, or chance has: the bounds are for medians over {SEEDS} clouds a row",
        )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _bound(low: float | None, high: float | None, unit: str) -> str:
    if low is not None and high is not None:
        return f"{low:.4g} .. {high:.4g} {unit}".rstrip()
    return f"<= {high:.4g} {unit}".rstrip() if high is not None else unit
