"""The skeleton line as a table: for spreadsheets, plots and `dlogen compare`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dlogen.io.registry import ModelFormat

if TYPE_CHECKING:
    from dlogen.types import FitData


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.skeleton.csv`: 1,000 rows, even in arc length.

    Columns: material coordinate s, arc length from the start, f(s), unit tangent, curvature (paper Eq. 16); metres.
    """
    import numpy as np

    from dlogen.geometry.arc_length import even_parameters
    from dlogen.geometry.curvature import curvature
    from dlogen.geometry.vectors import unit
    from dlogen.io.dump import csv_bytes

    line, points = result.skeleton, result.skeleton_points
    s = even_parameters(line, len(points))
    along = np.linspace(0.0, line.length, len(s))
    table = csv_bytes("s,arc_length,x,y,z,tx,ty,tz,curvature", s, along, points, unit(line(s, 1)), curvature(line, s))
    return {f"{stem}.skeleton.csv": table}


FORMAT = ModelFormat(
    name="csv",
    suffixes=(".skeleton.csv",),
    description="CSV table of the skeleton line: s, arc length, position, tangent, curvature",
    write=write,
)
