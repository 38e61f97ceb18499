"""The Python interface, as a notebook would use it."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dlogen
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube


def tube(name: str = "straight", count: int = 2000, seed: int = 3) -> np.ndarray:
    return sample_tube(centre_line(name), 0.02, count, np.random.default_rng(seed)).points


@pytest.fixture(scope="module")
def result() -> dlogen.Result:
    return dlogen.fit(tube("bent"), {"e_max": 0.05})


PUBLIC = [name for name in dlogen.__all__ if name != "__version__"]


def test_everything_that_is_promised_is_there() -> None:
    for name in dlogen.__all__:
        assert getattr(dlogen, name) is not None
    assert set(dlogen.__all__) <= set(dir(dlogen))
    with pytest.raises(AttributeError):
        dlogen.nothing  # noqa: B018


def test_what_is_exported() -> None:
    # A name that goes, or that is new, is a change of the interface: it belongs in the changelog as well.
    assert dlogen.__all__ == sorted(dlogen.__all__)
    assert {*PUBLIC} == {
        *("fit", "read_cloud", "read_raw", "write_cloud", "extract", "synth", "load_curve", "compare"),
        *("load_chain", "load_config", "tangent", "curvature", "forward_kinematics"),
        *("Result", "LoadedChain", "Skeleton", "Chain", "MultibodyModel", "Finding", "Config", "Curve"),
        *("Cloud", "RawCloud", "SyntheticCloud"),
        *("DlogenError", "InputError", "ConfigError", "UsageError", "OutputError", "FitError"),
    }


def test_type_checkers_see_what_python_sees() -> None:
    """The imports for type checkers, those at run time and `__all__` name the same things in the same places."""
    tree = ast.parse(Path(dlogen.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {alias.name: node.module for node in block.body for alias in node.names}
    assert dict(sorted(typed.items())) == dlogen._HOME
    assert set(typed) == set(PUBLIC)


def test_nothing_heavy_is_imported_before_it_is_used() -> None:
    code = "import sys, dlogen; print({'numpy', 'scipy', 'yaml', 'click', 'trimesh', 'plyfile'} & {*sys.modules})"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "set()"


def test_mypy_knows_the_types(tmp_path: Path) -> None:
    mypy = pytest.importorskip("mypy.api")
    script = tmp_path / "script.py"
    script.write_text(
        "import dlogen\n"
        "result = dlogen.fit([[0.0, 0.0, 0.0]])\n"
        "reveal_type(result)\n"
        "reveal_type(result.write('folder', 'urdf'))\n"
        "reveal_type(result.skeleton(0.5))\n"
        "reveal_type(dlogen.load_chain('cloud.json').model)\n"
        "reveal_type(dlogen.synth('bent').truth)\n"
        "result.nothing\n"
        "dlogen.fit(name=3)\n"
    )
    config = tmp_path / "mypy.ini"
    config.write_text("[mypy]\nstrict = true\n[mypy-scipy.*,trimesh.*,plyfile.*]\nignore_missing_imports = true\n")
    out, _, _ = mypy.run(
        [str(script), "--config-file", str(config), "--follow-imports=silent", f"--cache-dir={tmp_path / 'cache'}"]
    )
    revealed = [line.split('"')[1] for line in out.splitlines() if "Revealed type" in line]
    assert revealed[0] == "dlogen.io.result.Result"
    assert revealed[1].endswith("tuple[pathlib.Path, ...]")
    assert "ndarray" in revealed[2]
    assert revealed[3:] == ["dlogen.multibody.model.MultibodyModel", "dlogen.evaluation.centre_line.CentreLine"]
    errors = [line for line in out.splitlines() if ": error:" in line]
    assert len(errors) >= 2
    assert all(":8:" in line or ":9:" in line for line in errors), out


def documented() -> list[tuple[str, object]]:
    """Every public name, and the public methods and properties of every public class of ours."""
    found = []
    for name in PUBLIC:
        value = getattr(dlogen, name)
        found.append((name, value))
        if inspect.isclass(value):
            found += [(f"{name}.{key}", item) for key, item in vars(value).items() if not key.startswith("_")]
    return found


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_has_a_docstring_with_an_example(name: str) -> None:
    value = getattr(dlogen, name)
    text = inspect.getdoc(value) or ""
    assert len(text.splitlines()[0]) > 20, "says nothing"
    assert ">>> " in text, "has no example"
    if not inspect.isclass(value):
        assert "Args:" in text, "does not say what it takes"
        assert "Returns:" in text or value is dlogen.write_cloud, "does not say what it gives"
        assert "Raises:" in text, "does not say how it fails"


def test_public_members_have_docstrings() -> None:
    for name, value in documented():
        inner = value.func if hasattr(value, "func") else value
        if inspect.isroutine(inner) or isinstance(value, property):
            assert inspect.getdoc(inner), name


@pytest.mark.parametrize("module", sorted({"dlogen", "dlogen.types.line", *dlogen._HOME.values()}))
def test_the_examples_are_true(module: str) -> None:
    found = importlib.import_module(module)
    outcome = doctest.testmod(found, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert outcome.failed == 0
    assert outcome.attempted > 0 or module == "dlogen.types"  # whose examples are in the modules that it gathers


@pytest.mark.parametrize("name", PUBLIC)
def test_the_example_of_each_name_is_true(name: str) -> None:
    """Also of names that are only passed on by the module that they come from."""
    value = getattr(dlogen, name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    tests = doctest.DocTestFinder(recurse=False).find(value, name, globs={"dlogen": dlogen, "np": np})
    assert tests and tests[0].examples
    for test in tests:
        assert runner.run(test).failed == 0


def test_reprs_fit_on_a_screen(result: dlogen.Result, tmp_path: Path) -> None:
    path, *_ = result.write(tmp_path, ["json"])
    cloud = dlogen.synth("bent", 500)
    for value in (
        *(result, result.skeleton, result.chain, result.segmentation, result.mdtw, result.model, result.joints),
        *(
            dlogen.load_chain(path),
            dlogen.load_curve(path),
            cloud,
            cloud.truth,
            dlogen.fit.__globals__["clean"](tube()),
        ),
    ):
        text = repr(value)
        assert text.startswith(type(value).__name__)
        assert len(text.splitlines()) <= 3, text
        assert max(map(len, text.splitlines())) <= 120, text
    assert "length=" in repr(result.skeleton)


def test_a_point_of_the_line(result: dlogen.Result) -> None:
    line = result.skeleton
    assert line(0.5).shape == (3,)
    assert line([0.5]).shape == (1, 3)
    np.testing.assert_array_equal(line(0.25), line([0.25])[0])
    for wrong in (1.5, -0.001, np.nan, [0.5, 2.0]):
        with pytest.raises(ValueError, match="from 0 to 1"):
            line(wrong)


def test_tangent_and_curvature_are_those_of_the_curve(result: dlogen.Result) -> None:
    s, h = np.linspace(0.1, 0.9, 9), 1e-5
    line = result.skeleton
    along = (line(s + h) - line(s - h)) / (2 * h)
    np.testing.assert_allclose(dlogen.tangent(line, s), along / np.linalg.norm(along, axis=1, keepdims=True), atol=1e-6)
    turn = (dlogen.tangent(line, s + h) - dlogen.tangent(line, s - h)) / (2 * h)
    expected = np.linalg.norm(turn, axis=1) / np.linalg.norm(along, axis=1)
    np.testing.assert_allclose(dlogen.curvature(line, s), expected, rtol=1e-3, atol=1e-3)
    assert np.ndim(dlogen.curvature(line, 0.5)) == 0


def test_written_files_are_those_of_the_command_line(result: dlogen.Result, tmp_path: Path) -> None:
    from dlogen.io.report import report_dict

    paths = result.write(tmp_path / "models", "urdf,json,mjcf", force=False)
    assert [path.name for path in paths] == ["cloud.urdf", "cloud.json", "cloud.xml", "cloud.report.json"]
    assert all(path.stat().st_size > 1000 for path in paths)
    assert "mdtw" in report_dict(result)
    with pytest.raises(dlogen.UsageError, match="output exists"):
        result.write(tmp_path / "models", ["urdf"])
    result.write(tmp_path / "models", ["urdf"], force=True)
    with pytest.raises(dlogen.UsageError, match="unknown model format 'udrf'"):
        result.write(tmp_path, ["udrf"])


def test_fit_takes_an_array_and_a_mapping() -> None:
    result = dlogen.fit(tube(), {"profile": "paper", "r": 0.02, "e_max": 0.01})
    assert result.name == "cloud"
    assert result.chain.joints.shape[1] == 3
    assert result.max_deviation <= 0.01


def test_the_configuration_comes_back_resolved(result: dlogen.Result) -> None:
    assert isinstance(result.config, dlogen.Config)
    assert result.config.r == result.chain.radius
    assert result.config.e_max == result.e_max == 0.05
    assert result.skeleton.basis.size == result.config.N
    assert result.config.segmentation.criterion == "fewest"
    assert result.settings == result.config.to_dict() == result.provenance["config"]


def test_fit_takes_lists_and_drops_what_is_not_finite() -> None:
    points = np.vstack([tube(), [[np.nan, 0, 0]], tube()[:1]]).tolist()
    result = dlogen.fit(points, {"profile": "paper", "r": 0.02})
    assert result.provenance["dropped"] == {"non_finite": 1, "duplicates": 1}
    assert result.provenance["points"] == 2000


@pytest.mark.parametrize("wrong", [np.zeros((4, 2)), np.zeros(3), "cloud.ply", np.zeros((0, 3))])
def test_fit_refuses_what_is_no_cloud(wrong: object) -> None:
    with pytest.raises(dlogen.DlogenError):
        dlogen.fit(wrong)
