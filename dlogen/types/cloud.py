"""Point clouds: as their files have them, and clean."""

from __future__ import annotations

from dataclasses import dataclass, field

from dlogen.types.arrays import Array, IntArray
from dlogen.types.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class RawCloud(ShortRepr):
    """A cloud as its file has it: file order, NaN points kept, the file's own units.

    Attributes:
        points: (M, 3) float64.
        normals: (M, 3) float64, if the file stores any.
        viewpoint: (7,) sensor pose tx ty tz qw qx qy qz, if the file stores one.
        width, height: height > 1 for organised clouds (row-major, width * height = M).
        fields: names of all per-point fields of the file, in file order.
        format: registered name of the format ("ply", "pcd").
        encoding: how the points are stored ("ascii", "binary_little_endian", "binary_compressed", ...).
        comments: comment lines of the header, without the keyword.
        sha256: of the file, if there is one.
        triangles: (T, 3) indices into `points` of the triangles that faces are cut into, if the file is a mesh; as the
            file has them, so that they may name points that do not exist.

    >>> import dlogen, numpy as np
    >>> dlogen.RawCloud(np.full((6, 3), np.nan), width=3, height=2).organised
    True
    """

    points: Array
    normals: Array | None = None
    viewpoint: Array | None = None
    width: int = 0
    height: int = 1
    fields: tuple[str, ...] = ("x", "y", "z")
    format: str = ""
    encoding: str = ""
    comments: tuple[str, ...] = ()
    sha256: str = ""
    triangles: IntArray | None = None

    @property
    def organised(self) -> bool:
        """Whether the points are the pixels of an image."""
        return self.height > 1


@dataclass(frozen=True)
class Dropped:
    """How many points were left out on reading, by reason."""

    non_finite: int = 0
    duplicates: int = 0


@dataclass(frozen=True)
class Source:
    """Where a cloud came from."""

    name: str
    format: str
    encoding: str
    fields: tuple[str, ...]
    declared_points: int
    width: int
    height: int
    sha256: str


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(ShortRepr):
    """The mesh that the points of a cloud are the vertices of.

    Attributes:
        vertices: (V, 3) as the file has them, so that some may not be finite.
        triangles: (T, 3) indices of vertices, some of which may not exist.
    """

    vertices: Array
    triangles: IntArray


@dataclass(frozen=True, eq=False, repr=False)
class Cloud(ShortRepr):
    """A clean cloud: finite, free of exact duplicates.

    Attributes:
        points: (M, 3) float64.
        normals: (M, 3) as stored in the file but of unit length (zero for the few that are not usable), or None.
        viewpoint: (3,) position of the sensor in the frame of the points, or None.
        dropped: counts of what was left out on reading.
        source: file that it was read from; None for arrays.
        orientation: (4,) quaternion qw qx qy qz of the sensor, if the file stores one.
        mesh: the mesh whose vertices these are, if the file is one.

    >>> import dlogen, numpy as np
    >>> dlogen.Cloud(np.array([[0.0, 0.0, 0.1], [0.0, 0.1, 0.0]]))
    Cloud(points=array (2, 3), normals=None, viewpoint=None, dropped=Dropped, source=None, orientation=None, mesh=None)
    """

    points: Array
    normals: Array | None = None
    viewpoint: Array | None = None
    dropped: Dropped = field(default_factory=Dropped)
    source: Source | None = None
    orientation: Array | None = None
    mesh: Mesh | None = None

    def __len__(self) -> int:
        return len(self.points)
