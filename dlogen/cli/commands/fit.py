"""`dlogen fit`: one cloud to one model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command
from dlogen.cli.options import config_options, format_option

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dlogen.io.curves.curve import Curve
    from dlogen.types import Finding, FitData

#: Places of findings that a line of text names.
_PLACES = 8

_EXAMPLES = """Examples:

\b
  dlogen fit cloud.ply
  dlogen fit hose.pcd -c configs/vacuum_hose.yaml -o models
  dlogen fit scan.ply --set units=mm --set e_max=0.005 --format urdf
  dlogen fit cloud.ply --reference cloud.truth.json --json | jq .reference.mean
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("cloud", type=click.Path(allow_dash=True))
@config_options
@click.option(
    "--frame",
    "convention",
    type=click.Choice(["none", "optical-to-ros"]),
    help="Axes of the output: as in the cloud, or from a camera's optical frame to that of ROS.",
)
@click.option("--length", type=float, metavar="METRES", help="Known length of the object; short for --set length=...")
@click.option("-o", "--output", "folder", metavar="DIR", default=".", help="Folder for the outputs.  [default: .]")
@format_option("urdf,json")
@click.option("--reference", metavar="CURVE", help="Known centre line, in the frame of the output.")
@click.option("--dump", "dump_folder", metavar="DIR", help="Write what every stage made into this folder.")
@click.option("--plot", is_flag=True, help="Write a picture, NAME.png (needs matplotlib: dlogen[plots]).")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON to stdout.")
@click.option("--strict", is_flag=True, help="Exit 1 unless the verdict is good.")
@click.option("--force", is_flag=True, help="Overwrite existing outputs.")
def command(
    cloud: str,
    config_path: str | None,
    overrides: tuple[str, ...],
    convention: str | None,
    length: float | None,
    folder: str,
    formats: str,
    reference: str | None,
    dump_folder: str | None,
    plot: bool,
    as_json: bool,
    strict: bool,
    force: bool,
    console: Console,
) -> None:
    """Make a kinematic model from the point cloud CLOUD (PLY or PCD, - for stdin).

    Writes NAME.urdf, NAME.json (the kinematic chain) and NAME.report.json (the errors), all in metres.
    """
    from dlogen.config.reader import load_config
    from dlogen.errors import DlogenError, FitError, UsageError
    from dlogen.io.atomic import refuse_existing, write_all
    from dlogen.io.outputs import Outputs

    flags = [] if convention is None else [f"frame.convention={convention}"]
    flags += [] if length is None else [f"length={length!r}"]
    config = load_config(config_path, [*overrides, *flags])
    outputs = Outputs.parse(formats, plot)
    stem = "cloud" if cloud == "-" else Path(cloud).stem
    out = Path(folder)
    # Refuse before the work, not after it.
    refuse_existing([out / name for name in outputs.files(stem)], force)
    if cloud == "-" and (reference or "").partition("#")[0] == "-":
        raise UsageError("the cloud and the reference cannot both be read from stdin", "give one of them as a file")

    from dlogen.io.cloud_files import read_cloud
    from dlogen.io.report import report_dict
    from dlogen.pipeline import fit

    with console.status(f"fitting {stem}"):
        known = _load(reference) if reference else None
        data = read_cloud(cloud)
        try:
            result = fit(data, config, name=stem)
        except DlogenError as error:
            error.path = error.path or cloud
            raise
        compared = _against(known, result, config.mdtw.samples) if known else None
    report = report_dict(result, compared)
    contents = {out / name: data for name, data in outputs.contents(result, stem, report).items()}
    written = list(contents)
    dumps: dict[Path, bytes] = {}
    if dump_folder is not None:
        from dlogen.io.dump import dump_files

        dumps = {Path(dump_folder) / f"{stem}.{name}": data for name, data in dump_files(result).items()}
        refuse_existing(list(dumps), force)
    write_all({**contents, **dumps})

    _tell(result, console)
    if compared is not None:
        mean, largest = (1e3 * float(compared[key]) for key in ("mean", "max"))
        console.info(f"against {reference}: mean {mean:.3f} mm, max {largest:.3f} mm")
    # Of a folder its name.
    console.info("wrote " + ", ".join(dict.fromkeys(str(out / path.relative_to(out).parts[0]) for path in written)))
    if dumps:
        console.info(f"wrote into {dump_folder}: " + ", ".join(path.name for path in dumps))
    if as_json:
        print_json(report)
    if strict and not result.quality.is_good:
        raise FitError(
            f"the verdict is {result.quality.verdict}", "see the findings above, or leave --strict away", path=cloud
        )


def _load(reference: str) -> Curve:
    from dlogen.io.curves.curve import load_curve

    return load_curve(reference)


def _against(known: Curve, result: FitData, samples: int) -> dict[str, Any]:
    """The skeleton line against a known curve."""
    from dlogen.evaluation.comparison import compare
    from dlogen.geometry.arc_length import even_parameters

    line = result.skeleton(even_parameters(result.skeleton, samples))
    return compare(known.points, line, samples=samples)


def _tell(result: FitData, console: Console) -> None:
    """The outcome in a few lines for people."""
    chain = result.chain
    n = len(chain.lengths)
    segments = f"{n} segment{'s' if n > 1 else ''} of {1e3 * result.joints.segment_length:.1f} mm"
    if n > 1:
        segments += f" (last {1e3 * result.joints.last_segment_length:.1f} mm)"
    console.info(
        f"{result.name}: {result.skeleton.length:.4f} m long, radius {1e3 * chain.radius:.2f} mm; {segments}; "
        f"deviation {1e3 * result.max_deviation:.2f} mm (allowed {1e3 * result.e_max:.2f}); {result.quality.verdict}"
    )
    for text, quiet in _lines(result.quality.findings):
        console.detail(text) if quiet else console.warning(text)
    for made in (result.segmentation, *result.segmentation.alternatives):
        console.detail(
            f"  {made.criterion}, {made.placement}: n = {made.count}, l = {1e3 * made.joints.segment_length:.1f} mm, "
            f"deviation {1e3 * made.deviation:.2f} mm"
        )
    fewer = result.segmentation.fewer
    if fewer is not None:
        console.detail(f"  {fewer.count} segments: deviation {1e3 * fewer.deviation:.2f} mm at least")
    for stage, seconds in result.timings.items():
        console.detail(f"  {stage:<14}{1e3 * seconds:8.1f} ms")


def _place(finding: Finding) -> str:
    """Where a finding is: on the line, or beside it in metres."""
    if finding.s is not None:
        return f"s = {finding.s:.3f}"
    return "" if finding.position is None else "({:.3f}, {:.3f}, {:.3f})".format(*finding.position)


def _lines(findings: tuple[Finding, ...]) -> Iterator[tuple[str, bool]]:
    """Findings as text, those of a kind in one line with the worst one's message, and whether they are mere notes."""
    from dlogen.stages.quality.findings import SETTINGS_NOT_USED, UNITS

    kinds: dict[tuple[str, bool], list[Finding]] = {}
    for finding in findings:
        quiet = finding.is_note and not (SETTINGS_NOT_USED.matches(finding) or UNITS.matches(finding))
        kinds.setdefault((finding.code, quiet), []).append(finding)
    for (code, quiet), alike in kinds.items():
        first = max(alike, key=lambda finding: finding.gravity)
        count = f"{len(alike)} times: " if len(alike) > 1 else ""
        places = [place for place in map(_place, alike) if place]
        more = f" and {len(places) - _PLACES} more places" if len(places) > _PLACES else ""
        where = f" (at {', '.join(places[:_PLACES])}{more})" if places else ""
        yield f"{count}{first.message}{where} [{code}]", quiet
