"""PLY, the Polygon File Format (Stanford): ascii, binary little and big endian.

Read: the elements `vertex` and `face`, whatever other elements and properties there are. Two conventions of PCL are
kept as well: an element `camera` is the sensor pose, `obj_info num_cols` and `num_rows` make the cloud organised.
Written: coordinates (and normals) as `float` where that is exact and as `double` elsewhere, so nothing is lost.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from dlogen.errors import InputError
from dlogen.io.parsing.cloud_header import shorten
from dlogen.io.parsing.ply_header import ENCODINGS, Header, read_header
from dlogen.io.registry import CloudFormat

if TYPE_CHECKING:
    from dlogen.types import Array, RawCloud

_AXES = tuple(f"{axis}_axis{part}" for axis in "xyz" for part in "xyz")
#: Names of the list that has the corners of a face.
_CORNERS = ("vertex_indices", "vertex_index")
_CAMERA = ("view_px", "view_py", "view_pz", *_AXES)


def sniff(head: bytes) -> bool:
    """Whether a file that starts like this is a PLY file."""
    return re.match(rb"ply[ \t]*[\r\n]", head, re.IGNORECASE) is not None or head.strip().lower() == b"ply"


def read(path: Path) -> RawCloud:
    """The vertices of a PLY file.

    Numbers of ascii files are taken as they are written, also where the header calls them `float`.

    Raises:
        InputError: damaged, cut off, or without coordinates.
    """
    from dlogen.io.parsing.cloud_table import locate, split
    from dlogen.io.parsing.ply_rows import Polygons, read_rows
    from dlogen.types import RawCloud

    with path.open("rb") as stream:
        header = read_header(stream)
        vertex = header.index("vertex")
        if vertex is None:
            names = ", ".join(element.name for element in header.elements) or "none"
            raise InputError(
                f"there is no element 'vertex' in the PLY header (elements: {shorten(names)})",
                "the file holds no points: export it again with its vertices",
            )
        fields = header.elements[vertex].names
        points, normals = locate(["" if item.count else item.name for item in header.elements[vertex].properties])
        wanted = {vertex: points + (normals or [])}
        camera = _camera(header)
        if camera is not None:
            wanted[camera] = [header.elements[camera].names.index(name) for name in _CAMERA]
        faces = _faces(header)
        polygons = None if faces is None else Polygons(*faces)
        tables = read_rows(stream, header, wanted, polygons)

    xyz, normal = split(tables[vertex])
    columns, rows = header.shape
    organised = rows > 1 and columns * rows == len(xyz)
    return RawCloud(
        points=xyz,
        normals=normal,
        viewpoint=None if camera is None else _pose(tables[camera][0]),
        width=columns if organised else len(xyz),
        height=rows if organised else 1,
        fields=tuple(fields),
        format="ply",
        encoding=header.encoding,
        comments=header.comments,
        triangles=polygons.triangles if polygons is not None and len(polygons.triangles) else None,
    )


def write(path: Path, cloud: RawCloud, encoding: str) -> None:
    """Write points, normals, shape and sensor pose of a cloud; the same cloud gives the same bytes.

    Args:
        path: the file.
        cloud: its comments become comments, its fields beyond x y z and the normal are not in it.
        encoding: one of `FORMAT.encodings`.
    """
    import numpy as np

    from dlogen.geometry.rotations import from_quaternion
    from dlogen.io.parsing.cloud_table import records
    from dlogen.io.parsing.ply_writer import write_ply

    elements = {"vertex": records(cloud, ("nx", "ny", "nz"))}
    if cloud.viewpoint is not None:
        pose = np.concatenate([cloud.viewpoint[:3], from_quaternion(cloud.viewpoint[3:]).ravel()])
        elements["camera"] = np.array([tuple(pose)], dtype=[(name, "<f8") for name in _CAMERA])
    comments = [" ".join(comment.split()) for comment in cloud.comments]
    info = [f"num_cols {cloud.width}", f"num_rows {cloud.height}"] if cloud.organised else []
    with path.open("wb") as stream:
        write_ply(stream, elements, encoding, comments, info)


def _faces(header: Header) -> tuple[int, int] | None:
    """The element and the property that have the corners of faces, if the file is a mesh."""
    element = header.index("face")
    if element is None:
        return None
    for index, item in enumerate(header.elements[element].properties):
        if item.count and item.name.lower() in _CORNERS:
            return element, index
    return None


def _camera(header: Header) -> int | None:
    """The element that has the sensor pose, as PCL writes it."""
    index = header.index("camera")
    if index is None:
        return None
    camera = header.elements[index]
    usable = camera.rows == 1 and not camera.has_lists and set(_CAMERA) <= set(camera.names)
    return index if usable else None


def _pose(camera: Array) -> Array | None:
    """(12,) position and axes -> (7,) position and unit quaternion w x y z, upright where the axes are no rotation."""
    import numpy as np

    from dlogen.geometry.rotations import quaternion

    if not np.isfinite(camera[:3]).all():
        return None
    axes = camera[3:].reshape(3, 3)
    with np.errstate(all="ignore"):
        is_rotation = np.allclose(axes @ axes.T, np.eye(3), atol=1e-3) and np.linalg.det(axes) > 0.0
    return np.concatenate([camera[:3], quaternion(axes) if is_rotation else [1.0, 0.0, 0.0, 0.0]])


FORMAT = CloudFormat(
    name="ply",
    suffixes=(".ply",),
    description="Polygon File Format: points, normals, sensor pose",
    sniff=sniff,
    read=read,
    write=write,
    encodings=ENCODINGS,
)
