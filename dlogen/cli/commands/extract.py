"""`dlogen extract`: cuts the object out of a scene."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command
from dlogen.cli.options import encoding_option, units_option
from dlogen.cli.types import Auto, Count

_EXAMPLES = """Examples:

\b
  dlogen extract scene.pcd --background table.pcd -o cloud.ply
  dlogen extract scene.ply --background table.ply -o cloud.ply --threshold 0.008 -M all
  dlogen extract - --background table.pcd -o - < scene.pcd | dlogen fit -
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("scene", type=click.Path(allow_dash=True))
@click.option("--background", required=True, metavar="FILE", help="Cloud of the same place without the object.")
@click.option("-o", "--output", metavar="FILE", required=True, help="Cloud to write, PLY or PCD; - for stdout as PLY.")
@click.option(
    "--threshold",
    type=Auto(),
    default="auto",
    show_default=True,
    metavar="auto|METRES",
    help="Distance to the background from which on points belong to the object; auto measures the noise.",
)
@click.option(
    "-M",
    "--points",
    type=Count(),
    default=5000,
    show_default=True,
    metavar="COUNT|all",
    help="Number of points to draw at random from the object.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the drawing.")
@units_option("Of the clouds' numbers, for --threshold; the output keeps them.")
@encoding_option
@click.option("--json", "as_json", is_flag=True, help="Print what was found as JSON to stdout.")
@click.option("--force", is_flag=True, help="Overwrite an existing output.")
def command(
    scene: str,
    background: str,
    output: str,
    threshold: float | None,
    points: int | None,
    seed: int,
    units: str,
    encoding: str | None,
    as_json: bool,
    force: bool,
    console: Console,
) -> None:
    """Cut out of SCENE (PLY or PCD, - for stdin) what the background has not, and draw points from it.

    Organised clouds are compared pixel by pixel, others by the distance to the nearest point. Specks are left out. The
    output is in the scene's frame and units.
    """
    from dlogen.errors import UsageError
    from dlogen.io.atomic import refuse_existing, write_all

    if scene == background == "-":
        raise UsageError("both clouds cannot come from stdin", "name a file for one of them")
    if output == "-" and as_json:
        raise UsageError("the cloud and --json cannot both go to stdout", "name a file with -o")
    path = Path("cloud.ply" if output == "-" else output)
    if output != "-":
        refuse_existing([path], force)

    import numpy as np

    from dlogen.errors import DlogenError
    from dlogen.geometry.units import METRES
    from dlogen.io.cloud_files import cloud_bytes, read_raw
    from dlogen.stages.extract import down_sample, extract

    with console.status("extracting the object"):
        before, after = read_raw(background), read_raw(scene)
        try:
            whole = extract(
                after, before, threshold=None if threshold is None else threshold / METRES[units], count=None
            )
        except DlogenError as error:
            error.path = error.path or ("stdin" if scene == "-" else scene)
            raise
        cloud = whole if points is None else down_sample(whole, points, seed)
        content = cloud_bytes(path, cloud, encoding=encoding)
    seen = int(np.isfinite(after.points).all(axis=1).sum())
    console.info(
        f"scene: {len(after.points)} points, {seen} of them seen; object: {len(whole)} points, kept {len(cloud)}"
    )
    if output == "-":
        sys.stdout.buffer.write(content)
        return
    write_all({path: content})
    console.info(f"wrote {path}")
    if as_json:
        print_json(
            {
                "schema": "dlogen.extract/1",
                "cloud": str(path),
                "scene_points": len(after.points),
                "seen_points": seen,
                "object_points": len(whole),
                "points": len(cloud),
                "threshold": threshold,
                "seed": seed,
            }
        )
