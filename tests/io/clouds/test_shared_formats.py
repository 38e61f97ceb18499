"""Odd and ordinary files of other projects: each is read right, or refused with the reason.

The counts are those of the files' own headers and of other readers (plyfile, pypcd4).
"""

import numpy as np
import plyfile
import pytest
from places import DATA

from dlogen.errors import InputError
from dlogen.io.cloud_files import read_cloud, read_raw

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the shared test data are not here")

XYZ = ("x", "y", "z")
RGB = (*XYZ, "rgb")
PCL_NORMAL = ("normal_x", "normal_y", "normal_z", "curvature")
PLY_NORMAL = ("nx", "ny", "nz")
# name: points, finite points, points left by read_cloud, fields, encoding, stored normals
READ = {
    "formats/pcl_bun0.pcd": (397, 397, 397, (*XYZ, *PCL_NORMAL), "ascii", True),
    "formats/pcl_capture0001.pcd": (307200, 249647, 249647, XYZ, "binary_compressed", False),
    "formats/pcl_colored_cloud.pcd": (1000, 1000, 1000, (*RGB, *PCL_NORMAL), "binary", True),
    "formats/pcl_logo.pcd": (12909, 12909, 12909, RGB, "binary_compressed", False),
    "formats/pypcd4_ascii.pcd": (213, 213, 213, RGB, "ascii", False),
    "formats/pypcd4_ascii_multi_count.pcd": (8, 8, 8, (*XYZ, "intensity"), "ascii", False),
    "formats/pypcd4_ascii_organized.pcd": (8, 8, 8, (*XYZ, "intensity"), "ascii", False),
    "formats/pypcd4_binary.pcd": (213, 213, 213, RGB, "binary", False),
    "formats/pypcd4_binary_compressed.pcd": (213, 213, 213, RGB, "binary_compressed", False),
    "harness/test_cloud.pcd": (7166, 7166, 7166, XYZ, "ascii", False),
    "harness/test_cloud_occluded.pcd": (5165, 5165, 5165, XYZ, "ascii", False),
    "formats/pyntcloud_diamond_ascii.ply": (
        6,
        6,
        6,
        (*XYZ, *PLY_NORMAL, "red", "green", "blue", "alpha"),
        "ascii",
        True,
    ),
    "formats/pyntcloud_voxelgrid_crlf_bin.ply": (6, 6, 6, XYZ, "binary_little_endian", False),
    "formats/pytransform3d_frame.ply": (
        1134,
        1134,
        1129,
        (*XYZ, *PLY_NORMAL, "red", "green", "blue"),
        "binary_little_endian",
        True,
    ),
    "formats/small_gicp_source.ply": (69792, 69792, 64686, (*XYZ, "scalar_intensity"), "binary_little_endian", False),
    "formats/trimesh_metadata.ply": (4, 4, 4, XYZ, "ascii", False),
    "formats/trimesh_points_ascii.ply": (5, 5, 5, XYZ, "ascii", False),
    "formats/trimesh_points_ascii_with_lists.ply": (5, 5, 5, XYZ, "ascii", False),
    "formats/trimesh_points_bin.ply": (5, 5, 5, XYZ, "binary_little_endian", False),
    "formats/trimesh_points_emptyface.ply": (1024, 1024, 1024, XYZ, "ascii", False),
}
REFUSED = {
    "formats/meshio_lfs_pointer.ply": "Git LFS pointer.*git lfs pull",
    "formats/pypcd4_ascii_empty.pcd": "the file is empty",
    "formats/pypcd4_ascii_invalid_header.pcd": "no line 'DATA'",
    "formats/pypcd4_ascii_with_empty_points.pcd": "the file holds no points",
    "formats/trimesh_ply_empty_header.ply": "no element 'vertex'",
    "harness/wireHarness.txt": "a table of numbers.*loadtxt",
    "harness/curledRope.txt": "a table of numbers.*loadtxt",
}
SHAPES = {
    "formats/pcl_capture0001.pcd": (640, 480),
    "formats/pcl_colored_cloud.pcd": (1, 1000),
    "formats/pypcd4_ascii_organized.pcd": (4, 2),
}
POSES = {
    "formats/pcl_capture0001.pcd": [0, 0, 0, 0, 1, 0, 0],
    "formats/pcl_logo.pcd": [0, 0, -2, 0, 1, 0, 0],
}


def test_no_file_is_left_out():
    found = {f"{path.parent.name}/{path.name}" for path in DATA.glob("*/*") if path.suffix in (".ply", ".pcd", ".txt")}
    assert found == set(READ) | set(REFUSED)


@pytest.mark.parametrize("name", READ)
def test_read(name):
    declared, finite, left, fields, encoding, has_normals = READ[name]
    raw = read_raw(DATA / name)
    assert raw.points.shape == (declared, 3)
    assert int(np.isfinite(raw.points).all(axis=1).sum()) == finite
    assert raw.fields == fields
    assert (raw.format, raw.encoding) == (name.rsplit(".", 1)[1], encoding)
    assert (raw.normals is not None) == has_normals
    assert (raw.width, raw.height) == SHAPES.get(name, (declared, 1))
    pose = POSES.get(name, [0, 0, 0, 1, 0, 0, 0] if raw.format == "pcd" else None)
    assert pose is None or raw.viewpoint.tolist() == pose
    cloud = read_cloud(DATA / name)
    assert len(cloud) == left
    assert cloud.dropped.non_finite == declared - finite
    assert cloud.dropped.duplicates == finite - left
    assert left == len(np.unique(raw.points[np.isfinite(raw.points).all(axis=1)], axis=0))
    if has_normals and cloud.normals is not None:
        assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("name", [name for name in READ if name.endswith(".ply")])
def test_plyfile_reads_the_same(name):
    rows = plyfile.PlyData.read(DATA / name)["vertex"]
    raw = read_raw(DATA / name)
    # Where a text says `float`, plyfile rounds to single precision and dlogen does not.
    tolerance = 1e-7 if raw.encoding == "ascii" else 0.0
    names = [*XYZ, *(PLY_NORMAL if raw.normals is not None else ())]
    expected = np.column_stack([np.asarray(rows[field], dtype=float) for field in names])
    found = raw.points if raw.normals is None else np.hstack([raw.points, raw.normals])
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=0.0)


@pytest.mark.parametrize("name", [name for name in READ if name.endswith(".pcd")])
def test_pypcd4_reads_the_same(name):
    pypcd4 = pytest.importorskip("pypcd4")
    cloud = pypcd4.PointCloud.from_path(DATA / name)
    raw = read_raw(DATA / name)
    tolerance = 1e-7 if raw.encoding == "ascii" else 0.0
    names = [*XYZ, *(PCL_NORMAL[:3] if raw.normals is not None else ())]
    found = raw.points if raw.normals is None else np.hstack([raw.points, raw.normals])
    expected = np.column_stack([cloud.pc_data[field].astype(float) for field in names])
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=0.0)


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_the_reason(name):
    with pytest.raises(InputError, match=REFUSED[name]) as caught:
        read_cloud(DATA / name)
    assert caught.value.hint
    assert str(caught.value.path).endswith(name)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("name", ["pcl_colored_cloud.pcd", "pcl_bun0.pcd", "pytransform3d_frame.ply"])
@pytest.mark.parametrize("profile", ["refined", "paper"])
def test_clouds_of_other_things_are_refused_or_marked(name: str, profile: str) -> None:
    import dlogen

    cloud = read_cloud(DATA / "formats" / name)
    try:
        result = dlogen.fit(cloud, {"profile": profile})
    except dlogen.DlogenError as error:
        assert error.hint
    else:
        assert result.quality.verdict != "good"
