"""What holds for every model format: `dlogen fit` refuses exactly what it would overwrite."""

from __future__ import annotations

import pytest

from dlogen.evaluation.shapes import hose_centre_line
from dlogen.io.registry import model_format, model_formats

NAMES = [item.name for item in model_formats()]


@pytest.fixture(scope="module")
def result(fitted, make_result):
    return make_result(fitted(hose_centre_line()), 0.02, 0.01)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("stem", ["cable", "größe-線 2.b"])
def test_the_files_are_known_before_they_are_written(result, name: str, stem: str) -> None:
    chosen = model_format(name)
    written = chosen.write(result, stem)
    assert sorted(written) == sorted(chosen.files(stem))
    assert all(isinstance(content, bytes) and content for content in written.values())


def test_no_two_formats_write_the_same_file() -> None:
    files = [file for name in NAMES for file in model_format(name).files("cable")]
    assert len(set(files)) == len(files)


def test_no_format_writes_over_a_cloud_of_that_name() -> None:
    from dlogen.io.registry import cloud_formats

    clouds = {f"cable{suffix}" for item in cloud_formats() for suffix in item.suffixes}
    assert not clouds & {file for name in NAMES for file in model_format(name).files("cable")}


@pytest.mark.parametrize("name", NAMES)
def test_the_same_result_gives_the_same_bytes(result, name: str) -> None:
    chosen = model_format(name)
    assert chosen.write(result, "cable") == chosen.write(result, "cable")
