"""What is written is read back, bit by bit, by every cloud format in every encoding.

New formats are found by themselves.
"""

import numpy as np
import pytest

from dlogen.io.cloud_files import read_cloud, read_raw, write_cloud
from dlogen.io.registry import cloud_formats
from dlogen.types import RawCloud

ENCODINGS = [(item, encoding) for item in cloud_formats() for encoding in item.encodings]
pytestmark = pytest.mark.parametrize(
    ("file_format", "encoding"), ENCODINGS, ids=[f"{item.name}-{encoding}" for item, encoding in ENCODINGS]
)


@pytest.fixture
def path(tmp_path, file_format):
    return tmp_path / f"cloud{file_format.suffixes[0]}"


def tube(count=500, seed=0):
    """Points on a cylinder, with their outward normals."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    return 0.02 * normals + [0.0, 0.0, 1.0] * rng.uniform(0.0, 1.0, (count, 1)), normals


@pytest.mark.parametrize("offset", [0.0, 5e6])
def test_points_and_normals(path, encoding, file_format, offset):
    points, normals = tube()
    points = points + offset
    write_cloud(path, points, normals=normals, encoding=encoding)
    raw = read_raw(path)
    assert np.array_equal(raw.points, points)
    assert np.array_equal(raw.normals, normals)
    assert (raw.format, raw.encoding) == (file_format.name, encoding)
    assert (raw.width, raw.height) == (500, 1)
    assert len(raw.fields) == 6


def test_points_alone(path, encoding, file_format):
    points, _ = tube()
    write_cloud(path, points, encoding=encoding)
    raw = read_raw(path)
    assert np.array_equal(raw.points, points)
    assert raw.normals is None
    assert raw.fields == ("x", "y", "z")


def test_extreme_numbers(path, encoding, file_format):
    points = np.array(
        [
            [0.0, -0.0, 5e-324],
            [1.7976931348623157e308, -1e-300, 0.1],
            [np.nextafter(1.0, 2.0), 1 / 3, 1e22],
            [1e16, 2, 3],
        ]
    )
    write_cloud(path, points, encoding=encoding)
    assert read_raw(path).points.tobytes() == points.tobytes()


def test_single_precision_takes_less_space(path, encoding, file_format):
    points, _ = tube()
    sizes = []
    for values in (points, points.astype(np.float32).astype(np.float64)):
        write_cloud(path, values, encoding=encoding)
        assert np.array_equal(read_raw(path).points, values)
        sizes.append(path.stat().st_size)
    # Text has the same digits: a single precision number as a double is as long as any.
    assert encoding == "ascii" or sizes[1] < 0.7 * sizes[0]


def test_organised_with_gaps(path, encoding, file_format):
    points, normals = tube(12 * 7)
    points[::5] = np.nan
    points[3, 0], points[4, 2] = np.inf, -np.inf
    normals[::5] = np.nan
    write_cloud(path, RawCloud(points, normals, width=12, height=7), encoding=encoding)
    raw = read_raw(path)
    assert np.array_equal(raw.points, points, equal_nan=True)
    assert np.array_equal(raw.normals, normals, equal_nan=True)
    assert (raw.width, raw.height, raw.organised) == (12, 7, True)


def test_sensor_pose(path, encoding, file_format):
    points, _ = tube()
    half = np.sqrt(0.5)
    pose = [5e6 + 0.125, -2.0, 3.0, half, 0.0, half, 0.0]
    write_cloud(path, points, viewpoint=pose, encoding=encoding)
    assert read_raw(path).viewpoint == pytest.approx(pose, abs=1e-15)
    assert read_cloud(path).viewpoint.tolist() == pose[:3]


def test_clean_cloud_survives(path, encoding, file_format):
    points, normals = tube()
    points[7] = points[3]
    points[9, 1] = np.nan
    write_cloud(path, points, normals=normals, viewpoint=[1, 2, 3], encoding=encoding)
    cloud = read_cloud(path)
    again = path.with_name("again" + path.suffix)
    write_cloud(again, cloud, encoding=encoding)
    second = read_cloud(again)
    assert np.array_equal(second.points, cloud.points)
    assert second.normals == pytest.approx(cloud.normals, abs=1e-15)
    assert second.viewpoint.tolist() == [1, 2, 3]
    assert (cloud.dropped.non_finite, cloud.dropped.duplicates) == (1, 1)
    assert (second.dropped.non_finite, second.dropped.duplicates) == (0, 0)


def test_same_cloud_same_bytes(path, encoding, file_format):
    points, normals = tube()
    write_cloud(path, points, normals=normals, encoding=encoding)
    first = path.read_bytes()
    write_cloud(path, points.copy(), normals=normals.copy(), encoding=encoding)
    assert path.read_bytes() == first


def test_no_points(path, encoding, file_format):
    write_cloud(path, np.empty((0, 3)), encoding=encoding)
    assert read_raw(path).points.shape == (0, 3)


def test_content_decides_whatever_the_name(path, encoding, file_format):
    points, _ = tube()
    write_cloud(path, points, encoding=encoding)
    for name in ("cloud", "cloud.dat", *(f"cloud{item.suffixes[0]}" for item in cloud_formats())):
        other = path.with_name(name)
        path = path.rename(other)
        assert read_raw(path).format == file_format.name


def test_a_file_cut_off_anywhere_is_refused(path, encoding, file_format):
    from dlogen.errors import InputError

    points, _ = tube(40)
    write_cloud(path, points, encoding=encoding)
    data = path.read_bytes()
    # The last numbers of a text may lose digits, or the line end, without anybody being able to tell.
    end = len(data) - (24 if encoding == "ascii" else 0)
    for size in range(end):
        path.write_bytes(data[:size])
        with pytest.raises(InputError) as caught:
            read_raw(path)
        assert caught.value.hint
        assert caught.value.path == str(path)
