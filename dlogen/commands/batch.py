"""`dlogen batch`: many clouds to many models."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import click

from dlogen.cli import Command
from dlogen.console import Console

_EXAMPLES = """Examples:

\b
  dlogen batch captures -o models
  dlogen batch 'captures/**/*.pcd' -o models --set units=mm --format urdf,mjcf
  find captures -name '*.ply' -print0 | dlogen batch - -o models --jobs 4
  dlogen batch @captures.csv -o models --fail-above max_deviation=0.01
  dlogen batch captures -o models --json | jq -r 'select(.verdict != "good") | .cloud'
"""


class _Size(click.ParamType):
    """A number of bytes, with the units of people: 500M, 2G, 1.5GB."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([kMGT]?)(?:i?B)?\s*", value, re.IGNORECASE)
        size = float(match[1]) * 1024 ** " KMGT".index(match[2].upper() or " ") if match else 0.0
        if size < 1.0:
            self.fail(f"{value!r} is not a size such as 500M or 2G.", param, ctx)
        return int(size)


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("inputs", metavar="INPUT...", nargs=-1, required=True)
@click.option("-o", "--output", "folder", metavar="DIR", required=True, help="Folder for the results and the records.")
@click.option("-j", "--jobs", type=click.IntRange(1), metavar="N", help="Worker processes.  [default: all cores]")
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration for all clouds.")
@click.option("--set", "overrides", metavar="KEY=VALUE", multiple=True, help="Set one configuration key; repeatable.")
@click.option("--profile", type=click.Choice(["refined", "paper"]), help="Shorthand for --set profile=...")
@click.option(
    "--format",
    "formats",
    metavar="NAME,...",
    default="urdf,json",
    show_default=True,
    help="Model formats to write (see dlogen formats), or all.",
)
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
@click.option(
    "--timeout", type=click.FloatRange(0.0, min_open=True), metavar="SECONDS", help="Time that a cloud may take."
)
@click.option("--memory", type=_Size(), metavar="SIZE", help="Memory that a cloud may take, such as 2G.")
@click.option("--scheduler", metavar="ADDRESS", help="Let a Dask cluster do the work (needs dlogen[distributed]).")
@click.option(
    "--scheduler-file", metavar="FILE", help="As --scheduler, with the address from the scheduler's own file."
)
@click.option("--ship", is_flag=True, help="Send clouds and results: the cluster does not see the files here.")
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
    jobs: int | None,
    config_path: str | None,
    overrides: tuple[str, ...],
    profile: str | None,
    formats: str,
    plot: bool,
    one_model: bool,
    root: str | None,
    own_configs: bool,
    timeout: float | None,
    memory: int | None,
    scheduler: str | None,
    scheduler_file: str | None,
    ship: bool,
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
    from dlogen.batch.figures import Threshold
    from dlogen.batch.follow import follow
    from dlogen.batch.inputs import find_items
    from dlogen.batch.ledger import NAME as LEDGER
    from dlogen.batch.ledger import Ledger
    from dlogen.batch.pool import LocalPool, Pool
    from dlogen.batch.run import Batch, Settings
    from dlogen.batch.work import Plan
    from dlogen.batch.worker import can_limit_memory
    from dlogen.config import load_config
    from dlogen.errors import UsageError
    from dlogen.files import refuse_existing
    from dlogen.outputs import Outputs

    thresholds = [Threshold.parse(text) for text in limits]
    # The common model is made from the chains.
    outputs = Outputs.parse(f"{formats},json" if one_model and formats != "all" else formats, plot)
    given = (*overrides, *([f"profile={profile}"] if profile else []))
    config = load_config(config_path)
    # What is wrong for all clouds is said once.
    common = load_config(None, given, base=config)
    address = scheduler_address(scheduler, scheduler_file, jobs, ship, console)
    if memory is not None and address is None and not can_limit_memory():
        raise UsageError("--memory needs Linux", "leave it away, and use fewer --jobs")
    out = Path(folder)
    items = find_items(inputs, out=out, root=root, own_configs=own_configs, outputs=outputs.files)
    if one_model:
        # What an earlier run has made is made again.
        refuse_existing([out / "one_model"], force or (out / LEDGER).exists())
    plan = Plan(None if ship else str(out), config, given, outputs)

    ledger = Ledger(out)
    try:
        batch = Batch(items, out, plan, ledger, Settings(force, retry, ship))
        total = max(1, len(batch.todo))
        pool: Pool
        if address is None:
            pool = LocalPool(plan, min(jobs or cores(), total), timeout=timeout, memory=memory)
        else:
            from dlogen.batch.cluster import DaskPool

            pool = DaskPool(plan, address, total, timeout=timeout, memory=memory, say=console.info)

        def finish() -> None:
            from dlogen.commands.sequence import write_one_model

            keys = [item.key for item in items]
            rows = {row.key: row for row in ledger.rows()}
            write_one_model(keys, rows, out, common, outputs.formats, plot, console)

        follow(
            batch,
            pool,
            console,
            thresholds=thresholds,
            strict=strict,
            as_json=as_json,
            finish=finish if one_model else None,
        )
    finally:
        ledger.close()


def scheduler_address(
    address: str | None, file: str | None, jobs: int | None, ship: bool, console: Console
) -> str | None:
    """Address of a Dask scheduler, if the user wants one; Dask is imported only then."""
    from dlogen.errors import UsageError

    if address is None and file is None:
        if ship:
            raise UsageError("--ship is for clusters", "give their --scheduler as well")
        return None
    if address is not None and file is not None:
        raise UsageError("--scheduler and --scheduler-file contradict each other", "keep one of them")
    if jobs is not None:
        raise UsageError(
            "--jobs is for this machine, not for a cluster",
            "leave it away: the Dask workers have their own number of threads",
        )
    from dlogen.batch.cluster import prepare_dask, scheduler_of

    prepare_dask(verbose=console.level > 0)
    return address or scheduler_of(file or "")


def cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
