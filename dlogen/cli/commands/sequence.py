"""`dlogen sequence`: a recording of one object to one model and its motion."""

from __future__ import annotations

import contextlib
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command
from dlogen.cli.options import config_options, format_option, worker_options

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dlogen.batch.store import Row
    from dlogen.cli.workers import Workers
    from dlogen.config.schema import Config
    from dlogen.sequence.assemble import Assembled
    from dlogen.sequence.trajectory import Motion

_EXAMPLES = """Examples:

\b
  dlogen sequence recording --rate 30 -o motion
  dlogen sequence 'recording/*.pcd' -o motion --set material.preset=rope --format urdf,mjcf,sdf
  dlogen sequence @recording.csv -o motion --plot
  dlogen sequence recording -o motion --json | jq -r '.frames[] | select(.state != "good") | .name'
"""

#: Lines about captures on stderr; all of them are in the report.
_MOST_NAMED = 20

#: So many captures in a row that are excluded for the same reason are told of in one line.
_RUN = 3

#: So many captures in a row that do not fit in may be a part of another recording.
_PART = 5


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("inputs", metavar="FRAMES...", nargs=-1, required=True)
@click.option("-o", "--output", "folder", metavar="DIR", required=True, help="Folder for the results.")
@click.option(
    "--rate",
    type=click.FloatRange(0.0, min_open=True),
    metavar="HZ",
    help="Frames a second, where the numbers in the names are not times.",
)
@config_options
@format_option("urdf,mjcf")
@click.option("--keep-doubtful", is_flag=True, help="Go by frames whose verdict is doubtful as well.")
@click.option("--smooth", is_flag=True, help="Even out the noise from frame to frame.")
@click.option("--plot", is_flag=True, help="Write a picture, sequence.png (needs matplotlib: dlogen[plots]).")
@worker_options
@click.option("--retry", is_flag=True, help="Fit frames again that failed before.")
@click.option("--force", is_flag=True, help="Fit all frames again, and overwrite files of others.")
@click.option("--strict", is_flag=True, help="Exit 1 unless all frames are good and nothing is in doubt.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON to stdout.")
def command(
    inputs: tuple[str, ...],
    folder: str,
    rate: float | None,
    config_path: str | None,
    overrides: tuple[str, ...],
    formats: str,
    keep_doubtful: bool,
    smooth: bool,
    plot: bool,
    workers: Workers,
    retry: bool,
    force: bool,
    strict: bool,
    as_json: bool,
    console: Console,
) -> None:
    """Make one model of an object from a recording, and its motion.

    FRAMES are clouds as for dlogen batch: files, a folder, a quoted glob, @LIST (a CSV may have a column time). Each is
    fitted on its own, in DIR/frames; run again, only what is missing or has changed is fitted.

    Writes model.urdf and model.xml (MJCF, with a keyframe for each frame), trajectory.csv and trajectory.npz (time,
    pose of the base, joint values, error and state of each frame) and sequence.json. Frames that fail, are doubtful or
    do not fit in are named, and filled in from their neighbours.
    """
    from dlogen.batch.discover import find_items
    from dlogen.batch.job import Plan
    from dlogen.batch.runner import Batch, BatchOptions
    from dlogen.batch.store import NAME as STORE
    from dlogen.batch.store import Store
    from dlogen.cli.batch_progress import run_batch
    from dlogen.errors import FitError
    from dlogen.io.atomic import refuse_existing
    from dlogen.io.outputs import Outputs
    from dlogen.io.registry import model_format
    from dlogen.sequence.file_names import MODEL, file_names
    from dlogen.sequence.timestamps import capture_times

    workers.check()
    config, for_fits, overrides = _configs(config_path, overrides, console)
    wanted = Outputs.parse(formats).formats
    out, fits = Path(folder), Path(folder) / "frames"
    expected = [name for item in wanted for name in model_format(item).files(MODEL)]
    expected += file_names(in_time=True, plot=plot)
    # What an earlier run has made is made again.
    refuse_existing([out / name for name in expected], force or (fits / STORE).exists())

    outputs = Outputs(("json",))
    items = find_items(inputs, out=fits, own_configs=False, outputs=outputs.files, warn=console.warning)
    times = capture_times([item.key for item in items], [item.time for item in items], rate)
    items = [items[k] for k in times.order]
    if times.assumed and len(items) > 1:
        console.warning("the names of the frames hold no times: one frame a second is assumed")
        console.hint("say how many there are a second: --rate HZ")

    plan = Plan(None if workers.ship else str(fits), for_fits, overrides, outputs)
    store = Store(fits)
    try:
        batch = Batch(items, fits, plan, store, BatchOptions(force, retry, workers.ship))
        run_batch(batch, workers.pool(plan, len(batch.todo), console), console, tolerant=True)
        rows = {row.key: row for row in store.rows()}
    finally:
        store.close()

    # Only now: who waits for an error in the call need not wait for numpy.
    from dlogen.sequence.assemble import assemble

    with console.status("putting the frames together"):
        made = assemble(
            [item.key for item in items],
            rows,
            fits,
            config,
            wanted,
            times=times,
            rate=rate,
            keep_doubtful=keep_doubtful,
            smooth=smooth,
            plot=plot,
        )
    _write(made, out, console, in_time=True)
    if as_json:
        print_json(made.report)
    excluded = sum(state != "good" for state in made.motion.states)
    if strict and excluded:
        raise FitError(
            f"{excluded} of {len(items)} frames are set aside", "see above, or leave --strict away", path=out
        )
    if strict and made.motion.model.doubts:
        raise FitError("the motion is in doubt", "see above, or leave --strict away", path=out)


def _configs(path: str | None, given: tuple[str, ...], console: Console) -> tuple[Config, Config, tuple[str, ...]]:
    """What the model and what the single fits are made with, and what wins over settings of a capture.

    In a recording the base floats, and joint values are zero when straight. The fits do without what is for the model
    only: the segments of a capture alone are of no interest, and when the model's settings change, nothing has to be
    fitted again.
    """
    from dlogen.config.reader import load_config
    from dlogen.config.schema import Config
    from dlogen.config.sections import JointSettings

    def of_the_model(key: str) -> bool:
        section, _, name = key.strip().rpartition(".")
        return section in ("segmentation", "joints", "material") or name == "e_max"

    loaded = load_config(path, base=Config(joints=JointSettings(base="floating", zero="straight")))
    model = load_config(None, given, base=loaded)
    if model.joints.base == "fixed":
        console.warning("joints.base = fixed is not used: in a recording the base moves")
    defaults = Config().to_dict()
    changes = {"e_max": defaults["e_max"]}
    for section in ("segmentation", "joints", "material"):
        changes |= {f"{section}.{name}": value for name, value in defaults[section].items()}
    for_captures = tuple(text for text in given if not of_the_model(text.partition("=")[0]))
    return _floating(model), loaded.replace(changes), for_captures


def _floating(config: Config) -> Config:
    """For a model in several poses, by the criterion that the profile has for one."""
    from dlogen.config.fields import AUTO

    changes = {"joints.base": "floating"}
    if config.profile == "paper" and config.segmentation.criterion == AUTO and _by_e_max(config):
        changes["segmentation.criterion"] = "paper"
    return config.replace(changes)


def _by_e_max(config: Config) -> bool:
    """Whether nothing else says how long the segments are."""
    from dlogen.config.fields import AUTO

    segmentation = config.segmentation
    return all(value == AUTO for value in (segmentation.segments, segmentation.segment_length))


def write_one_model(
    keys: Sequence[str],
    rows: Mapping[str, Row],
    folder: Path,
    config: Config,
    formats: Sequence[str],
    plot: bool,
    console: Console,
) -> None:
    """One model for all clouds of a batch, in no order: `dlogen batch --one-model`.

    Args:
        keys: of the clouds.
        rows: records of the batch by key.
        folder: of the batch; the model goes to `one_model` in it.
        config: of the batch.
        formats: of the model.
        plot: make a picture.
        console: for messages.

    Raises:
        DlogenError: there is none, or it cannot be written.
    """
    from dlogen.sequence.assemble import assemble

    made = assemble(keys, rows, folder, _floating(config).replace({"joints.zero": "straight"}), formats, plot=plot)
    out = folder / "one_model"
    _write(made, out, console, in_time=False)


def _write(made: Assembled, out: Path, console: Console, *, in_time: bool) -> None:
    """Write all files, and say how it went and where they are.

    Models and picture of an earlier run that had another outcome are removed: beside the new files they would pass for
    what they are not.
    """
    from dlogen.io.atomic import write_all
    from dlogen.io.registry import model_formats
    from dlogen.sequence.file_names import MODEL, file_names

    *_, report, picture = file_names(in_time, plot=True)
    others = {name for item in model_formats() for name in item.files(MODEL)} | {picture}
    changed = (out / report).is_file() and (out / report).read_bytes() != made.contents[report]
    write_all({out / name: data for name, data in made.contents.items()})
    for name in others - made.contents.keys() if changed else ():
        with contextlib.suppress(OSError):
            (out / name).unlink()
    _tell(made.motion, console)
    console.info("wrote " + ", ".join(dict.fromkeys(str(out / Path(name).parts[0]) for name in made.contents)))


def _tell(motion: Motion, console: Console) -> None:
    """The outcome in a few lines for people."""
    from dlogen.sequence.reasons import MOTION
    from dlogen.types.texts import counted

    model = motion.model
    good = model.good
    sizes, bend = model.sizes, model.bend
    names = [item.name for item in model.captures]
    worst = max((k for k in range(len(names)) if good[k]), key=lambda k: float(model.deviation[k]))
    segments = f"{counted(len(model.links), 'segment')} of {1e3 * model.links[0]:.1f} mm"
    what = counted(len(names), "frame" if motion.times is not None else "cloud")
    console.info(
        f"{what}, {motion.states.count('good')} good: {sizes.length.value:.4f} m long, radius "
        f"{1e3 * sizes.radius.value:.2f} mm; {segments}; deviation {1e3 * model.deviation[worst]:.2f} mm at most, in "
        f"{names[worst]} (allowed {1e3 * model.e_max:.2f}); bent to {bend.radius:.3g} m in {names[bend.capture]}"
    )
    _tell_some([f"{doubt.message} [{doubt.code}]" for doubt in model.doubts], console)
    _tell_some(_exclusion_lines(motion), console)
    if any(code == MOTION.code and len(run) >= _PART for code, _, run in _runs(motion)):
        console.hint("if the recording has a cut, or its object was moved meanwhile, give the parts one by one")
    if model.deviation[worst] > model.e_max:
        console.warning("the segments are too long to follow the tightest bends within e_max")


def _tell_some(lines: Sequence[str], console: Console) -> None:
    for line in lines[:_MOST_NAMED]:
        console.warning(line)
    if len(lines) > _MOST_NAMED:
        console.warning(f"and {len(lines) - _MOST_NAMED} others: see the report")


def _runs(motion: Motion) -> Iterator[tuple[str, str, list[int]]]:
    """Captures that are excluded: code of the reason, state, and those in a row that share both."""
    exclusions = motion.model.exclusions
    of_each = [
        (exclusion.code if exclusion else "", state) for exclusion, state in zip(exclusions, motion.states, strict=True)
    ]
    for (code, state), run in groupby(range(len(of_each)), key=of_each.__getitem__):
        if code:
            yield code, state, list(run)


def _exclusion_lines(motion: Motion) -> list[str]:
    """A line for every capture that is excluded; one for many in a row, which is one reason more often than not."""
    model = motion.model
    lines = []
    for code, state, run in _runs(motion):
        first, last = (model.captures[k].name for k in (run[0], run[-1]))
        why = [f"{exclusion.message} [{code}]" for k in run if (exclusion := model.exclusions[k])]
        if motion.times is not None and len(run) >= _RUN:
            lines.append(f"{first} to {last} are {state}, {len(run)} frames: such as {first}: {why[0]}")
            continue
        what = "has no pose" if state == "none" else f"is {state}"
        lines += [f"{model.captures[k].name} {what}: {text}" for k, text in zip(run, why, strict=True)]
    return lines
