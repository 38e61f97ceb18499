"""`dlogen synth`: clouds of tubes whose axis is known."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command
from dlogen.cli.options import encoding_option, units_option
from dlogen.cli.sensor_options import cuts_out, refuse_contradictions, seen, sensor_options
from dlogen.cli.types import Number, Numbers

if TYPE_CHECKING:
    import numpy as np

    from dlogen.evaluation.centre_line import CentreLine
    from dlogen.types import RawCloud

#: Shapes, and which of the options about the centre line they take.
SHAPES: dict[str, tuple[str, ...]] = {
    "bent": (),
    "straight": (),
    "helical": (),
    "helical-printed": (),
    "random": ("length", "bend_radius"),
    "loop": ("length",),
    "coil": ("length",),
    "hose": ("length", "bend_radius"),
}

#: Options that a camera decides itself.
_WITHOUT_CAMERA = ("points", "noise", "stray", "gaps", "density_ratio", "side", "caps", "offset")

_EXAMPLES = """Examples:

\b
  dlogen synth bent -o cloud.ply
  dlogen synth random -o cloud.pcd --seed 7 --noise 0.002 --side 0,0,-1
  dlogen synth --centre-line axis.csv -o cloud.ply --diameter 0.012 --gap 0.4:0.5
  dlogen synth hose -o scene.pcd --camera kinect-v1
  dlogen synth hose --length 1 --bend-radius 0.08 --diameter 0.006 -o rope.pcd --camera realsense-d435 --mask-grow 1
  dlogen synth bent -o - | dlogen fit -
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("shape", type=click.Choice(list(SHAPES)), required=False, metavar="[SHAPE]")
@click.option(
    "--centre-line",
    "centre_line",
    metavar="FILE",
    help="Curve to use instead of a SHAPE, in metres: a CSV of x, y, z, or any file that dlogen compare reads.",
)
@click.option("-o", "--output", metavar="FILE", required=True, help="Cloud to write, PLY or PCD; - for stdout as PLY.")
@click.option(
    "-M", "--points", type=click.IntRange(1), default=5000, show_default=True, help="Number of points in the cloud."
)
@click.option(
    "--diameter", type=Number(1e-6, 1e3), default=0.04, show_default=True, metavar="METRES", help="Of the tube."
)
@click.option(
    "--noise",
    type=Number(0.0),
    default=0.0,
    show_default=True,
    metavar="METRES",
    help="Standard deviation of each coordinate.",
)
@click.option(
    "--stray",
    type=Number(0.0, 1.0, max_open=True),
    default=0.0,
    show_default=True,
    metavar="SHARE",
    help="Share of the points that lie anywhere in the tube's surroundings.",
)
@click.option(
    "--gap",
    "gaps",
    type=Numbers("S0:S1"),
    multiple=True,
    help="Part of the length (0 to 1) without points; repeatable.",
)
@click.option(
    "--density-ratio",
    type=Number(0.0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="RATIO",
    help="Density of the points at the end over that at the start.",
)
@click.option(
    "--side",
    type=Numbers("X,Y,Z"),
    help="Only what a far viewer sees who looks in this direction; - signs are allowed.",
)
@click.option("--caps", is_flag=True, help="Put points on the flat ends, too.")
@click.option(
    "--length",
    type=Number(1e-3, 100.0),
    metavar="METRES",
    help="Length of random, loop, coil (1.4 each) and hose (1.7).",
)
@click.option(
    "--bend-radius",
    type=Number(1e-3, 100.0),
    metavar="METRES",
    help="Smallest radius of curvature of random (0.1, or a 14th of the length) and hose (0.145).",
)
@units_option("Of the cloud's numbers; the truth is always in metres.")
@click.option("--offset", type=Numbers("X,Y,Z"), help="Move everything, metres: a cloud far from the origin.")
@encoding_option
@sensor_options
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of everything random.")
@click.option("--json", "as_json", is_flag=True, help="Print what was made as JSON to stdout.")
@click.option("--force", is_flag=True, help="Overwrite existing outputs.")
def command(
    shape: str | None,
    centre_line: str | None,
    output: str,
    points: int,
    diameter: float,
    noise: float,
    stray: float,
    gaps: tuple[tuple[float, float], ...],
    density_ratio: float,
    side: tuple[float, ...] | None,
    caps: bool,
    length: float | None,
    bend_radius: float | None,
    units: str,
    offset: tuple[float, ...] | None,
    encoding: str | None,
    camera: str | None,
    sensing: dict[str, Any],
    seed: int,
    as_json: bool,
    force: bool,
    console: Console,
) -> None:
    """Make the point cloud of a tube whose axis is known.

    SHAPE is one of the paper's Table I (bent, straight, helical; helical-printed with its misprint), or random, loop
    (crosses itself), coil, hose (the paper's experiment). The axis is written beside the cloud as NAME.truth.json.
    """
    has_background = camera is not None and not cuts_out(sensing)
    _refuse_contradictions(shape, centre_line, output, camera, has_background, as_json)
    refuse_contradictions(camera, sensing)

    from dlogen.io.atomic import refuse_existing, write_all
    from dlogen.types.texts import millimetres

    to_stdout = output == "-"
    cloud_path = Path("cloud.ply" if to_stdout else output)
    truth_path = cloud_path.with_suffix(".truth.json")
    background_path = cloud_path.with_suffix(f".background{cloud_path.suffix}")
    if not to_stdout:
        refuse_existing([cloud_path, truth_path, *([background_path] if has_background else [])], force)

    import numpy as np

    from dlogen.evaluation.synthetic import truth, truth_bytes
    from dlogen.io.cloud_files import cloud_bytes

    settings: dict[str, Any] = {"diameter": diameter, "units": units}
    rng = np.random.default_rng(seed)
    background = None
    with console.status(f"making {cloud_path.name}"):
        if shape is not None:
            line = _shape(shape, rng, diameter, length, bend_radius)
        else:
            assert centre_line is not None
            line = _read_line(centre_line)
        if offset is not None:
            settings["offset"] = offset
            line = line.moved(np.eye(3), np.array(offset))
        if camera is not None:
            from dlogen.evaluation.sensors.models import SENSORS

            settings |= {"camera": camera, "distance": SENSORS[camera].usual} | sensing
            cloud, background, line = seen(camera, line, diameter / 2, rng, sensing)
        else:
            sampling = {
                "noise": noise,
                "stray_fraction": stray,
                "gaps": gaps,
                "density_ratio": density_ratio,
                "side": side,
                "caps": caps,
            }
            settings |= {"points": points, **sampling}
            cloud = _sample(line, diameter / 2, points, rng, sampling)
        clouds = {cloud_path: cloud} | ({background_path: background} if background else {})
        contents = {path: cloud_bytes(path, _stored(cloud, units), encoding=encoding) for path, cloud in clouds.items()}
        known = truth(line, diameter / 2, settings, seed)
        bend = 1.0 / max(line.max_curvature(), 1e-12)
    if bend < diameter / 2:
        console.warning(
            f"no such tube exists: the axis bends to a radius of {millimetres(bend)}, the tube's own radius is "
            f"{millimetres(diameter / 2)}"
        )
    if to_stdout:
        sys.stdout.buffer.write(contents[cloud_path])
        return
    write_all({**contents, truth_path: truth_bytes(known)})
    finite = int(np.isfinite(cloud.points).all(axis=1).sum())
    console.info(f"{line.name}: {line.length:.4f} m long, {1e3 * diameter:.4g} mm thick; {finite} points")
    console.info("wrote " + ", ".join(str(path) for path in [*contents, truth_path]))
    if as_json:
        print_json(
            {
                "schema": "dlogen.synth/1",
                "cloud": str(cloud_path),
                "background": str(background_path) if has_background else None,
                "truth": str(truth_path),
                "points": len(cloud.points),
                "finite_points": finite,
                "min_bend_radius": bend if bend < 1e6 else None,
                **{key: value for key, value in known.items() if key not in ("schema", "points")},
            }
        )


def _refuse_contradictions(
    shape: str | None,
    centre_line: str | None,
    output: str,
    camera: str | None,
    has_background: bool,
    as_json: bool,
) -> None:
    """Raise `UsageError` for options that do not go together."""
    from dlogen.errors import UsageError

    context = click.get_current_context()
    names = {option.name: max(option.opts, key=len) for option in context.command.params}

    def given(options: tuple[str, ...]) -> list[str]:
        return [
            names[option] for option in options if context.get_parameter_source(option) is not ParameterSource.DEFAULT
        ]

    if shape is not None and centre_line is not None:
        raise UsageError(f"both the shape {shape} and --centre-line are given", "leave one of them away")
    if shape is None and centre_line is None:
        raise UsageError("there is nothing to make", f"give one of {', '.join(SHAPES)}, or --centre-line FILE")
    takes = SHAPES[shape] if shape else ()
    if unfit := given(tuple({"length", "bend_radius"} - set(takes))):
        takers = ", ".join(name for name, options in SHAPES.items() if set(options) & {"length", "bend_radius"})
        raise UsageError(
            f"{shape or 'a given centre line'} has no {' and '.join(sorted(unfit))}",
            f"leave it away; {takers} can be sized (see dlogen synth --help)",
        )
    if camera is not None and (unfit := given(_WITHOUT_CAMERA)):
        raise UsageError(
            f"{', '.join(unfit)} and --camera contradict each other",
            "the sensor decides what is seen; dlogen extract draws points from it",
        )
    if output == "-" and has_background:
        raise UsageError(
            "a camera makes two clouds: they do not fit into stdout", "name a file with -o, or --mask-grow"
        )
    if output == "-" and as_json:
        raise UsageError("the cloud and --json cannot both go to stdout", "name a file with -o")


@contextmanager
def _as_usage_error(hint: str) -> Iterator[None]:
    """Turn a `ValueError` of `dlogen.evaluation.shapes` or `synthetic` into a message."""
    from dlogen.errors import UsageError

    try:
        yield
    except ValueError as error:
        raise UsageError(str(error), hint) from error


def _shape(
    shape: str, rng: np.random.Generator, diameter: float, length: float | None, bend_radius: float | None
) -> CentreLine:
    from dlogen.evaluation.shapes import shape_by_name

    with _as_usage_error("choose another --length, --bend-radius, --diameter or --seed"):
        return shape_by_name(shape, rng, diameter=diameter, length=length, bend_radius=bend_radius)


def _read_line(source: str) -> CentreLine:
    """The smooth line through the points of a file."""
    from dlogen.errors import InputError
    from dlogen.evaluation.centre_line import from_points
    from dlogen.io.curves.curve import load_curve

    curve = load_curve(source)
    try:
        return from_points(curve.points, Path(curve.name).stem)
    except ValueError as error:
        raise InputError(str(error), "leave out repeated points", path=curve.name) from error


def _sample(
    line: CentreLine, radius: float, points: int, rng: np.random.Generator, sampling: dict[str, Any]
) -> RawCloud:
    """Random points on the tube."""
    from dlogen.evaluation.synthetic import sample_tube
    from dlogen.types import RawCloud

    with _as_usage_error("dlogen synth --help says what --gap and --side take"):
        return RawCloud(sample_tube(line, radius, points, rng, **sampling).points)


def _stored(cloud: RawCloud, units: str) -> RawCloud:
    """The numbers that are written, in the units asked for.

    Images are in single precision, as sensors give them. Other points are rounded to 1e-7 m, which hides the last bit:
    there the sine of one machine differs from that of another.
    """
    from dataclasses import replace

    import numpy as np

    from dlogen.geometry.units import METRES

    if cloud.viewpoint is not None:
        scale = np.array([*[METRES[units]] * 3, 1.0, 1.0, 1.0, 1.0])
        cloud = replace(cloud, viewpoint=cloud.viewpoint / scale)
    if cloud.organised:
        return replace(cloud, points=(cloud.points / METRES[units]).astype(np.float32).astype(float))
    decimals = {"m": 7, "cm": 5, "mm": 4}[units]
    return replace(cloud, points=np.round(cloud.points / METRES[units], decimals))
