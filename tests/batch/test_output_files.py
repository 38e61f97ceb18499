"""The files of one cloud: where they are, and what is left when their process was killed."""

from __future__ import annotations

from pathlib import Path

from dlogen.batch.output_files import paths_of, remove_temporaries, write_files
from dlogen.io.atomic import temporary_prefix
from dlogen.io.outputs import Outputs


def test_results_lie_below_the_folder_of_the_batch(tmp_path: Path) -> None:
    made = paths_of(tmp_path, "a/b/x", Outputs(("urdf", "ros2"), plot=True))
    assert tmp_path / "a" / "b" / "x.urdf" in made
    assert tmp_path / "a" / "b" / "x.report.json" in made
    assert tmp_path / "a" / "b" / "x.png" in made
    assert tmp_path / "a" / "b" / "x_description" / "package.xml" in made
    write_files(str(tmp_path), "a/b/x", {path.name: b"" for path in made[:1]})
    assert made[0].exists()


def test_temporary_files_of_a_process_that_was_killed(tmp_path: Path) -> None:
    outputs = Outputs(("urdf", "ros2"))
    own = [path.parent / f"{temporary_prefix(7)}abc.urdf" for path in paths_of(tmp_path, "a/x", outputs)]
    other = tmp_path / "a" / f"{temporary_prefix(77)}abc.urdf"
    elsewhere = tmp_path / "b" / f"{temporary_prefix(7)}abc.urdf"
    result = tmp_path / "a" / "x.urdf"
    for path in (*own, other, elsewhere, result):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"half")
    remove_temporaries(tmp_path, "a/x", outputs, 7)
    assert not any(path.exists() for path in own)
    assert other.exists()
    remove_temporaries(tmp_path, "a/x", outputs)
    assert not other.exists()
    assert elsewhere.exists()
    assert result.exists()
