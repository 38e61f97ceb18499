"""`dlogen batch`: many clouds to many models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dlogen.cli.console import Console
from dlogen.cli.main import Command
from dlogen.cli.options import config_options, format_option, worker_options

if TYPE_CHECKING:
    from dlogen.cli.workers import Workers

_EXAMPLES = """Examples:

\b
  dlogen batch captures -o models
  dlogen batch 'captures/**/*.pcd' -o models --set units=mm --format urdf,mjcf
  find captures -name '*.ply' -print0 | dlogen batch - -o models --jobs 4
  dlogen batch @captures.csv -o models --fail-above max_deviation=0.01
  dlogen batch captures -o models --json | jq -r 'select(.verdict != "good") | .cloud'
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("inputs", metavar="INPUT...", nargs=-1, required=True)
@click.option("-o", "--output", "folder", metavar="DIR", required=True, help="Folder for the results and the records.")
@config_options
@format_option("urdf,json")
@click.option("--plot", is_flag=True, help="Write a picture of every cloud (needs matplotlib: dlogen[plots]).")
@click.option(
    "--one-model", is_flag=True, help="Also make one model for all clouds, with its pose in each, in DIR/one_model."
)
@click.option("--root", metavar="DIR", help="Results keep the layout that the clouds have below this folder.")
@click.option(
    "--own-configs/--no-own-configs",
    default=True,
    help="Take x.yaml beside x.ply for that cloud's configuration.  [default: yes]",
)
@worker_options
@click.option("--retry", is_flag=True, help="Do clouds again that failed before.")
@click.option("--force", is_flag=True, help="Do all clouds again, and overwrite files of others.")
@click.option(
    "--fail-above",
    "limits",
    metavar="FIGURE=LIMIT",
    multiple=True,
    help="Exit 1 when a cloud's figure is above this, such as max_deviation=0.01; repeatable.",
)
@click.option("--strict", is_flag=True, help="Exit 1 unless all verdicts are good.")
@click.option("--json", "as_json", is_flag=True, help="Print a line of JSON for each cloud as it is done.")
def command(
    inputs: tuple[str, ...],
    folder: str,
    config_path: str | None,
    overrides: tuple[str, ...],
    formats: str,
    plot: bool,
    one_model: bool,
    root: str | None,
    own_configs: bool,
    workers: Workers,
    retry: bool,
    force: bool,
    limits: tuple[str, ...],
    strict: bool,
    as_json: bool,
    console: Console,
) -> None:
    """Make models from many clouds.

    INPUT is a file, a folder, a quoted glob, @LIST (a file with a name on each line, or a CSV with a column cloud), or
    - for a list on stdin. Results keep the folder layout of the clouds. A cloud that fails does not stop the others.
    Run again, it does only what is missing or has changed.

    DIR/dlogen.sqlite has a row for every cloud while it runs, DIR/summary.csv and DIR/summary.json at the end.
    """
    from dlogen.batch.discover import find_items
    from dlogen.batch.job import Plan
    from dlogen.batch.metrics import Threshold
    from dlogen.batch.runner import Batch, BatchOptions
    from dlogen.batch.store import NAME as STORE
    from dlogen.batch.store import Store
    from dlogen.cli.batch_progress import run_batch
    from dlogen.config.reader import load_config
    from dlogen.io.atomic import refuse_existing
    from dlogen.io.outputs import Outputs

    thresholds = [Threshold.parse(text) for text in limits]
    # The shared model is made from the chains.
    outputs = Outputs.parse(f"{formats},json" if one_model and formats != "all" else formats, plot)
    workers.check()
    config = load_config(config_path)
    # What is wrong for all clouds is said once.
    common = load_config(None, overrides, base=config)
    out = Path(folder)
    items = find_items(inputs, out=out, root=root, own_configs=own_configs, outputs=outputs.files, warn=console.warning)
    if one_model:
        # What an earlier run has made is made again.
        refuse_existing([out / "one_model"], force or (out / STORE).exists())
    plan = Plan(None if workers.ship else str(out), config, overrides, outputs)

    store = Store(out)
    try:
        batch = Batch(items, out, plan, store, BatchOptions(force, retry, workers.ship))
        pool = workers.pool(plan, len(batch.todo), console)

        def finish() -> None:
            from dlogen.cli.commands.sequence import write_one_model

            keys = [item.key for item in items]
            rows = {row.key: row for row in store.rows()}
            write_one_model(keys, rows, out, common, outputs.formats, plot, console)

        run_batch(
            batch,
            pool,
            console,
            thresholds=thresholds,
            strict=strict,
            as_json=as_json,
            finish=finish if one_model else None,
        )
    finally:
        store.close()
