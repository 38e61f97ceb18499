"""Names for files that are not point clouds that dlogen reads, so that a refusal says what to do instead."""

from __future__ import annotations

import re

_CLOUD = "convert it to PLY or PCD, for instance with CloudCompare or Open3D"
_MESH = "export it as PLY, or sample points of its surface: trimesh.load(file).sample(5000), then dlogen.write_cloud"
_TABLE = "convert it in Python: dlogen.write_cloud('cloud.ply', numpy.loadtxt('cloud.xyz')[:, :3])"
_UNPACK = "unpack it first"
_IMAGE = "dlogen needs points in space: turn a depth image into an organised cloud first, for instance with Open3D"
_RECORDING = "export one cloud of it as PLY or PCD, for instance with pcl_ros bag_to_pcd or the rosbags package"

# What files start with, what that is, and what to do about it.
_STARTS: tuple[tuple[bytes, str, str], ...] = (
    (b"version https://git-lfs", "a Git LFS pointer: the file itself was not downloaded", "run: git lfs pull"),
    (b"LASF", "a LAS or LAZ file", _CLOUD),
    (b"ASTM-E57", "an E57 file", _CLOUD),
    (b"DRACO", "a Draco file", _CLOUD),
    (b"glTF", "a binary glTF model", _MESH),
    (b"solid ", "an STL mesh", _MESH),
    (b"OFF\n", "an OFF mesh", _MESH),
    (
        b"\x93NUMPY",
        "a numpy array",
        "convert it in Python: dlogen.write_cloud('cloud.ply', numpy.load('cloud.npy')[:, :3])",
    ),
    (b"PK\x03\x04", "a zip archive", _UNPACK),
    (b"PK\x05\x06", "an empty zip archive", "download or pack it again"),
    (b"\x1f\x8b", "gzip data", "unpack it first: gunzip, or pipe it: zcat cloud.ply.gz | dlogen fit -"),
    (b"BZh", "bzip2 data", _UNPACK),
    (b"\xfd7zXZ", "xz data", _UNPACK),
    (b"\x28\xb5\x2f\xfd", "Zstandard data", _UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", _UNPACK),
    (b"Rar!", "a rar archive", _UNPACK),
    (b"\x89PNG", "a PNG image", _IMAGE),
    (b"\xff\xd8\xff", "a JPEG image", _IMAGE),
    (b"GIF8", "a GIF image", _IMAGE),
    (b"BM", "a BMP image", _IMAGE),
    (b"II*\x00", "a TIFF image", _IMAGE),
    (b"MM\x00*", "a TIFF image", _IMAGE),
    (b"\x76\x2f\x31\x01", "an OpenEXR image", _IMAGE),
    (b"%PDF", "a PDF document", "give a point cloud"),
    (b"\x89HDF", "an HDF5 file", _CLOUD),
    (b"SQLite format 3", "an SQLite database (ROS 2 bags are such)", _RECORDING),
    (b"#ROSBAG", "a ROS bag", _RECORDING),
    (b"\x89MCAP", "an MCAP recording", _RECORDING),
    (b"\x7fELF", "a program", "give a point cloud"),
)
_SUFFIXES: dict[str, tuple[str, str]] = {
    ".stl": ("an STL mesh", _MESH),
    ".obj": ("an OBJ mesh", _MESH),
    ".off": ("an OFF mesh", _MESH),
    ".gltf": ("a glTF model", _MESH),
    ".dae": ("a COLLADA model", _MESH),
    ".fbx": ("an FBX model", _MESH),
    ".las": ("a LAS file", _CLOUD),
    ".laz": ("a LAZ file", _CLOUD),
    ".e57": ("an E57 file", _CLOUD),
    ".ptx": ("a PTX scan", _CLOUD),
    ".pts": ("a PTS scan", _CLOUD),
    ".xyz": ("a table of numbers", _TABLE),
    ".txt": ("a table of numbers", _TABLE),
    ".csv": ("a table of numbers", _TABLE),
    ".asc": ("a table of numbers", _TABLE),
    ".bin": ("a headerless binary file", _CLOUD),
}
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def by_content(head: bytes) -> tuple[str, str] | None:
    """What a file is that starts with these bytes, and what to do about it; None where that cannot be told."""
    for start, what, hint in _STARTS:
        if head.startswith(start):
            return what, hint
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    lower = text[:1024].lower()
    if lower.startswith((b"<!doctype html", b"<html")):
        return "a web page: a download that went wrong", "open the address in a browser to see what it says"
    if lower.startswith(b"<"):
        if b"<robot" in lower:
            return "a URDF model", "dlogen writes URDF from point clouds; it reads one only in: dlogen compare"
        return "an XML file", "give a point cloud"
    if lower.startswith((b"{", b"[")):
        return "a JSON file", "give a point cloud; dlogen compare reads chains"
    first = text.split(b"\n", 1)[0]
    if re.match(rb"(v|vn|mtllib|o)\s", first) or re.search(rb"\nv\s+[-+.\d]+\s+[-+.\d]+\s+[-+.\d]+", text):
        return "an OBJ mesh", _MESH
    words = re.split(rb"[\s,;]+", first.strip())
    if len(words) > 1 and all(map(_NUMBER.fullmatch, words)):
        return "a table of numbers", _TABLE
    return None


def by_suffix(suffix: str) -> tuple[str, str] | None:
    """What a file is whose name ends like this, and what to do about it."""
    return _SUFFIXES.get(suffix.lower())
