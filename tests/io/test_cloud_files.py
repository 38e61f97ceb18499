"""Finding the format, refusing all else by name, cleaning, stdin and pipes."""

import gzip
import hashlib
import io
import os
import sys
import threading
import time
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dlogen
from dlogen.errors import InputError, UsageError
from dlogen.io.cloud_files import cloud_bytes, read_cloud, read_raw, write_cloud
from dlogen.types import Cloud, RawCloud

POINTS = np.array([[0.5, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]])


def numpy_file():
    stream = io.BytesIO()
    np.save(stream, POINTS)
    return stream.getvalue()


def zip_file():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("cloud.ply", "ply\n")
    return stream.getvalue()


class TestRefusedByName:
    @pytest.mark.parametrize(
        ("name", "content", "message"),
        [
            ("a.stl", b"solid part\n facet normal 0 0 1\n", "an STL mesh"),
            ("a.stl", bytes(80) + b"\x01\x00\x00\x00" + bytes(50), "an STL mesh"),
            ("a.ply", b"solid part\n facet normal 0 0 1\n", "an STL mesh"),
            ("a.obj", b"# made by hand\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\n", "an OBJ mesh"),
            ("a.dat", b"# made by hand\nv 0 0 0\nv 1 0 0\n", "an OBJ mesh"),
            ("a.off", b"OFF\n3 1 0\n", "an OFF mesh"),
            ("a.glb", b"glTF\x02\x00\x00\x00", "a binary glTF model"),
            ("a.las", b"LASF" + bytes(300), "a LAS or LAZ file"),
            ("a.e57", b"ASTM-E57" + bytes(40), "an E57 file"),
            ("a.ptx", b"\x00\x01", "a PTX scan"),
            ("a.xyz", b"0.1 0.2 0.3\n1 2 3\n", "a table of numbers"),
            ("a.txt", b"x y z\n1 2 3\n", "a table of numbers"),
            ("a.csv", b"0.1,0.2,0.3\n", "a table of numbers"),
            ("a.ply", b"0.1; 0.2; 0.3\n", "a table of numbers"),
            ("a.pcd", b" -1e-3\t2\t3\r\n", "a table of numbers"),
            ("a.npy", numpy_file(), "a numpy array"),
            ("a.zip", zip_file(), "a zip archive"),
            ("a.ply.gz", gzip.compress(b"ply\n", mtime=0), "gzip data"),
            ("a.ply", gzip.compress(b"ply\n", mtime=0), "gzip data"),
            ("a.png", b"\x89PNG\r\n\x1a\n", "a PNG image"),
            ("a.jpg", b"\xff\xd8\xff\xe0", "a JPEG image"),
            ("a.tiff", b"II*\x00", "a TIFF image"),
            ("a.urdf", b'<?xml version="1.0"?>\n<robot name="cable">', "a URDF model"),
            ("a.xml", b"<?xml version='1.0'?><scene>", "an XML file"),
            ("a.ply", b"<!DOCTYPE html><html><title>404", "a web page"),
            ("a.ply", b"version https://git-lfs.github.com/spec/v1\noid sha256:26d0\nsize 381\n", "a Git LFS pointer"),
            ("a.pcd", b"version https://git-lfs.github.com/spec/v1\noid sha256:26d0\nsize 381\n", "a Git LFS pointer"),
            ("a.json", b'{"schema": "dlogen.chain/1"}', "a JSON file"),
            ("a.bag", b"#ROSBAG V2.0\n", "a ROS bag"),
            ("a.db3", b"SQLite format 3\x00", "an SQLite database"),
            ("a.mcap", b"\x89MCAP0\r\n", "an MCAP recording"),
            ("a.ply", b"", "the file is empty"),
            ("a.ply", b"nothing of the kind\n", "not a PLY file: its first line is 'nothing of the kind'"),
            ("a.pcd", b"nothing of the kind\n", "no line 'DATA'"),
            ("a.dat", b"nothing of the kind\n", "not a point cloud that dlogen knows: it reads PCD and PLY"),
            ("a", b"\x00\x01\x02", "not a point cloud that dlogen knows"),
        ],
    )
    def test_content_and_names(self, tmp_path, name, content, message):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(InputError, match=message) as caught:
            read_cloud(path)
        assert caught.value.hint
        assert caught.value.path == str(path)

    def test_long_lines_of_digits_take_no_time(self, tmp_path):
        path = tmp_path / "cloud.ply"
        path.write_bytes(b"0.123456789 " * 300 + b"x\n" + b"1" * 4000)
        start = time.perf_counter()
        with pytest.raises(InputError):
            read_raw(path)
        assert time.perf_counter() - start < 1.0

    def test_missing(self, tmp_path):
        with pytest.raises(InputError, match="No such file") as caught:
            read_cloud(tmp_path / "cloud.ply")
        assert "check the path" in caught.value.hint

    def test_folder(self, tmp_path):
        with pytest.raises(InputError, match="folder") as caught:
            read_cloud(tmp_path)
        assert "dlogen batch" in caught.value.hint

    def test_device(self):
        with pytest.raises(InputError, match="not an ordinary file"):
            read_cloud("/dev/zero")

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
    def test_not_allowed(self, tmp_path):
        path = tmp_path / "cloud.ply"
        write_cloud(path, POINTS)
        path.chmod(0)
        with pytest.raises(InputError, match="Permission denied"):
            read_cloud(path)

    def test_errors_of_the_disk(self, tmp_path, monkeypatch):
        path = tmp_path / "cloud.ply"
        write_cloud(path, POINTS)

        def fail(*_args, **_keywords):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("pathlib.Path.open", fail)
        with pytest.raises(InputError, match="Permission denied") as caught:
            read_cloud(path)
        assert "permissions" in caught.value.hint

    @settings(deadline=None)
    @given(st.binary(max_size=300))
    def test_any_bytes(self, tmp_path_factory, data):
        path = tmp_path_factory.getbasetemp() / "anything.bin"
        path.write_bytes(data)
        with pytest.raises(InputError) as caught:
            read_raw(path)
        assert caught.value.hint


class TestReading:
    def test_source(self, tmp_path):
        path = tmp_path / "my cable.ply"
        write_cloud(path, np.vstack([POINTS, POINTS, np.full((1, 3), np.nan)]), normals=np.ones((9, 3)))
        source = read_cloud(path).source
        assert source.name == "my cable.ply"
        assert (source.format, source.encoding) == ("ply", "binary_little_endian")
        assert source.fields == ("x", "y", "z", "nx", "ny", "nz")
        assert (source.declared_points, source.width, source.height) == (9, 9, 1)
        assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()

    def test_a_raw_cloud_is_not_read_again(self, tmp_path):
        path = tmp_path / "cloud.ply"
        write_cloud(path, POINTS)
        raw = read_raw(path)
        path.unlink()
        cloud = read_cloud(path, raw=raw)
        assert np.array_equal(cloud.points, POINTS)
        assert cloud.source.sha256 == raw.sha256 != ""

    def test_nothing_but_nan(self, tmp_path):
        path = tmp_path / "cloud.pcd"
        write_cloud(path, np.full((6, 3), np.nan))
        with pytest.raises(InputError, match="all 6 points are NaN or infinite") as caught:
            read_cloud(path)
        assert caught.value.path == path

    def test_stdin(self, monkeypatch, tmp_path):
        path = tmp_path / "cloud.pcd"
        write_cloud(path, POINTS, encoding="binary_compressed")
        data = path.read_bytes()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        cloud = read_cloud("-")
        assert np.array_equal(cloud.points, POINTS)
        assert cloud.source.name == "stdin"
        assert cloud.source.sha256 == hashlib.sha256(data).hexdigest()

    def test_stdin_errors_name_it(self, monkeypatch):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
        with pytest.raises(InputError, match=r"^stdin: the file is empty"):
            read_cloud("-")

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
    def test_pipe(self, tmp_path):
        path, pipe = tmp_path / "cloud.ply", tmp_path / "pipe"
        write_cloud(path, POINTS)
        os.mkfifo(pipe)
        writer = threading.Thread(target=lambda: pipe.write_bytes(path.read_bytes()))
        writer.start()
        try:
            assert np.array_equal(read_cloud(pipe).points, POINTS)
        finally:
            writer.join()

    def test_no_temporary_file_is_left(self, monkeypatch, tmp_path):
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"junk")))
        with pytest.raises(InputError):
            read_cloud("-")
        assert list(tmp_path.iterdir()) == []


class TestWriting:
    def test_public_names(self):
        assert dlogen.read_cloud is read_cloud
        assert dlogen.write_cloud is write_cloud

    def test_what_can_be_written(self, tmp_path):
        path = tmp_path / "deeper" / "cloud.PLY"
        normals = np.tile([0.0, 0.0, 1.0], (4, 1))
        for cloud in (POINTS, POINTS.tolist(), Cloud(POINTS), RawCloud(POINTS)):
            write_cloud(path, cloud, normals=normals, viewpoint=[1, 2, 3])
            raw = read_raw(path)
            assert np.array_equal(raw.points, POINTS)
            assert np.array_equal(raw.normals, normals)
            assert raw.viewpoint.tolist() == [1, 2, 3, 1, 0, 0, 0]

    def test_own_normals_and_viewpoint(self, tmp_path):
        path = tmp_path / "cloud.pcd"
        write_cloud(path, Cloud(POINTS, POINTS, viewpoint=np.array([7.0, 8.0, 9.0])))
        raw = read_raw(path)
        assert np.array_equal(raw.normals, POINTS)
        assert raw.viewpoint.tolist() == [7, 8, 9, 1, 0, 0, 0]

    @pytest.mark.parametrize(
        ("name", "keywords", "message"),
        [
            ("cloud.stl", {}, "no cloud format has the name ending '.stl'"),
            ("cloud", {}, "no cloud format has the name ending ''"),
            ("cloud.ply", {"encoding": "binary"}, "ply has no encoding 'binary'"),
            ("cloud.pcd", {"encoding": "binary_big_endian"}, "pcd has no encoding 'binary_big_endian'"),
            ("cloud.ply", {"normals": np.zeros((3, 3))}, "3 normals for 4 points"),
            ("cloud.ply", {"normals": np.zeros((4, 2))}, "the normals have the shape"),
            ("cloud.ply", {"viewpoint": [1, 2]}, "the viewpoint is not 3 or 7 finite numbers"),
            ("cloud.ply", {"viewpoint": [1, 2, np.nan]}, "the viewpoint is not 3 or 7 finite numbers"),
        ],
    )
    def test_refused(self, tmp_path, name, keywords, message):
        with pytest.raises(UsageError, match=message) as caught:
            write_cloud(tmp_path / name, POINTS, **keywords)
        assert caught.value.hint
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("points", [[[1, 2, 3], [4, 5]], [["a", "b", "c"]], [1, 2, 3], np.zeros((4, 2))])
    def test_points_of_no_shape(self, tmp_path, points):
        with pytest.raises(UsageError, match="the points"):
            write_cloud(tmp_path / "cloud.ply", points)

    @pytest.mark.parametrize("name", ["cloud.ply", "cloud.pcd"])
    def test_bytes_of_a_file(self, tmp_path, name):
        write_cloud(tmp_path / name, POINTS, encoding="ascii")
        assert cloud_bytes(name, POINTS, encoding="ascii") == (tmp_path / name).read_bytes()
        with pytest.raises(UsageError) as caught:
            cloud_bytes("cloud.stl", POINTS)
        assert caught.value.path == "cloud.stl"

    def test_a_shape_that_does_not_fit(self, tmp_path):
        with pytest.raises(UsageError, match="3 x 2 pixels do not fit 4 points"):
            write_cloud(tmp_path / "cloud.pcd", RawCloud(POINTS, width=3, height=2))

    def test_a_place_that_cannot_be_written(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(UsageError, match="cannot write"):
            write_cloud(tmp_path / "file" / "cloud.ply", POINTS)


def _seconds(function):
    """Of the fastest of three calls."""
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        function()
        taken.append(time.perf_counter() - start)
    return min(taken)
