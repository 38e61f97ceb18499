"""Chains that were written come back as they were; what is damaged is refused with one kind of error."""

from __future__ import annotations

import contextlib
import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from configurations import ANYTHING
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dlogen.errors import InputError
from dlogen.evaluation.shapes import centre_line
from dlogen.evaluation.synthetic import sample_tube
from dlogen.io import chain_file
from dlogen.io.chain_file import LoadedChain, load_chain
from dlogen.io.result import Result
from dlogen.multibody.model import forward_kinematics
from dlogen.pipeline import fit

POINTS = sample_tube(centre_line("bent"), 0.02, 1500, 5).points

#: Settings of a fit, and how far the cloud is away.
VARIANTS: dict[str, tuple[dict[str, Any], float]] = {
    "refined": ({}, 0.0),
    "paper": ({"profile": "paper", "r": 0.02}, 0.0),
    "straight zero, three hinges": ({"joints": {"zero": "straight", "dof": 3}}, 0.0),
    "floating": ({"joints": {"base": "floating", "zero": "straight"}}, 0.0),
    "springs and limits": ({"joints": {"min_bend_radius": 0.1}, "material": {"preset": "rope"}}, 0.0),
    "far off": ({}, 5e6),
    "frame with a name": ({"frame": {"name": "camera"}}, 0.0),
    "paper, far off": ({"profile": "paper", "r": 0.02, "joints": {"zero": "straight"}}, -3e5),
}


@pytest.fixture(scope="module", params=VARIANTS)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """A result, and the chain that it wrote."""
    config, away = VARIANTS[request.param]
    result = fit(POINTS + away, {"e_max": 0.05, **config}, name="hose.v2")
    path, _ = result.write(tmp_path_factory.mktemp("chain"), ["json"])
    return result, path


@pytest.fixture(scope="module")
def loaded(written: tuple[Result, Path]) -> tuple[Result, LoadedChain]:
    return written[0], load_chain(written[1])


class TestRoundTrip:
    def test_line(self, loaded: tuple[Result, LoadedChain]) -> None:
        result, chain = loaded
        s = np.linspace(0.0, 1.0, 101)
        for derivative in range(4):
            np.testing.assert_array_equal(chain.skeleton(s, derivative), result.skeleton(s, derivative))
        assert chain.skeleton.length == result.skeleton.length
        np.testing.assert_array_equal(chain.skeleton_points, result.skeleton_points)

    def test_chain(self, loaded: tuple[Result, LoadedChain]) -> None:
        result, chain = loaded
        for name in ("joints", "s", "transforms", "lengths", "radius"):
            np.testing.assert_array_equal(getattr(chain.chain, name), getattr(result.chain, name))
        assert chain.joints is chain.chain.joints
        assert chain.transforms is chain.chain.transforms

    def test_model(self, loaded: tuple[Result, LoadedChain]) -> None:
        result, chain = loaded
        expected, model = result.model, chain.model
        np.testing.assert_array_equal(chain.joint_values, expected.scanned)
        np.testing.assert_array_equal(model.straight, expected.straight)
        for name in ("name", "root", "tip", "floating", "dof", "zero", "rest", "material", "bodies", "hinge_names"):
            assert getattr(model, name) == getattr(expected, name), name
        for ours, theirs in zip(model.joints, expected.joints, strict=True):
            for name in ("rotation", "rest", "lower", "upper", "damping", "stiffness", "bend_limit"):
                np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), name)

    def test_forward_kinematics_lead_to_the_joints(self, loaded: tuple[Result, LoadedChain]) -> None:
        _, chain = loaded
        assert len(chain.joints) > 5
        # What double precision leaves of 5e6 m.
        tolerance = max(1e-12, 1e-15 * float(np.abs(chain.joints).max()))
        reached = forward_kinematics(chain.model, chain.joint_values)
        np.testing.assert_allclose(reached, chain.joints, rtol=0.0, atol=20 * tolerance)
        assert chain.joint_values.shape == (len(chain.joints) - 2, chain.config.joints.dof)
        assert chain.joint_values.any() == (chain.config.joints.zero == "straight")

    def test_the_rest(self, loaded: tuple[Result, LoadedChain]) -> None:
        result, chain = loaded
        assert chain.name == "hose.v2"
        for name in ("profile", "e_max", "max_deviation", "config", "provenance", "quality"):
            assert getattr(chain, name) == getattr(result, name), name
        assert chain.frame.name == result.frame.name
        np.testing.assert_array_equal(chain.frame.transform, result.frame.transform)

    def test_the_file_is_what_was_written(self, written: tuple[Result, Path]) -> None:
        """The joint values that stand in the file are those that are worked out again on reading."""
        _, path = written
        joints = json.loads(path.read_text())["model"]["joints"]
        np.testing.assert_array_equal(load_chain(path).joint_values, [joint["scanned"] for joint in joints])


def test_the_name_of_the_frame_is_that_of_the_root() -> None:
    """So that none of the variants above passes because all have the same name."""
    roots = {
        name: fit(POINTS, {"e_max": 0.05, **VARIANTS[name][0]}).model.root for name in ("refined", "frame with a name")
    }
    assert roots["frame with a name"] == "camera" != roots["refined"]


@pytest.fixture(scope="module")
def data(make_result: Callable[..., Result], fitted: Any, circle: Any) -> dict[str, Any]:
    """A small chain with one finding as its file has it; few points of the skeleton line."""
    from dlogen.io.report import chain_dict

    result = make_result(fitted(circle(0.5, 2.0)), e_max=0.02)
    held = json.loads(json.dumps(chain_dict(result)))
    held["skeleton"]["points"] = held["skeleton"]["points"][:4]
    held["provenance"]["config"] = result.config.to_dict()
    held["quality"]["findings"] = [
        {"code": "gap", "message": "no points", "severity": "note", "s": 0.5, "position": [0.0, 1.0, 2.0]}
    ]
    return held


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("chains") / "cable.json"


def refused(path: Path, content: Any = None) -> InputError:
    """The error with which this is refused; it says which file, what is wrong, and what to do."""
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    with pytest.raises(InputError) as caught:
        load_chain(path)
    error = caught.value
    assert error.path == path
    assert error.message and error.hint
    assert error.exit_code == 2
    return error


def paths_in(value: Any, before: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where every value of nested data is."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*before, key)
        yield from paths_in(inner, (*before, key))


@contextlib.contextmanager
def opened(data: dict[str, Any], path: tuple[Any, ...]) -> Iterator[tuple[Any, Any, dict[str, Any]]]:
    """What holds the value at a path of a copy of the data, its key there, and the copy."""
    whole = copy.deepcopy(data)
    inner: Any = whole
    for key in path[:-1]:
        inner = inner[key]
    yield inner, path[-1], whole


NEEDED = [
    *("schema", "profile", "skeleton", "links", "joints", "joint_s", "radius", "frame", "frame_transform"),
    *("e_max", "max_deviation", "quality", "provenance"),
    *("skeleton.basis", "skeleton.length", "skeleton.points"),
    *("skeleton.basis.kind", "skeleton.basis.size", "skeleton.basis.weights", "skeleton.basis.offset"),
    *("links.0.length", "links.0.transform", "quality.findings", "provenance.config"),
    *("quality.findings.0.code", "quality.findings.0.message", "quality.findings.0.severity"),
]


def as_path(dotted: str) -> tuple[Any, ...]:
    return tuple(int(part) if part.isdigit() else part for part in dotted.split("."))


class TestRefusals:
    def test_the_small_chain_itself_is_none(self, data: dict[str, Any], place: Path) -> None:
        place.write_text(json.dumps(data))
        chain = load_chain(place)
        assert chain.name == "cable"
        assert len(chain.joints) == len(data["joints"])
        assert chain.quality.findings[0].position == (0.0, 1.0, 2.0)

    def test_no_such_file(self, tmp_path: Path) -> None:
        assert refused(tmp_path / "nowhere.json").message.startswith("cannot read: ")
        assert refused(tmp_path).message.startswith("cannot read: ")

    def test_a_report_is_no_chain(self, written: tuple[Result, Path]) -> None:
        error = refused(written[1].with_name("hose.v2.report.json"))
        assert "its schema is 'dlogen.report/1', not 'dlogen.chain/1'" in error.message
        assert error.hint == "give NAME.json, not NAME.report.json"

    @pytest.mark.parametrize("content", [[], {}, 3, "dlogen.chain/1", ["schema"], {"schema": "dlogen.chain/2"}])
    def test_other_json(self, content: Any, place: Path) -> None:
        assert refused(place, content).message.startswith("this is not a chain: its schema is ")

    @pytest.mark.parametrize(
        "content",
        [b"", b"cable", b"\x89PNG\r\n", b"\xff\xfe{}", b"[" * 100_000, b"{'schema': 1}", b'{"schema": 1} 2'],
        ids=["empty", "text", "picture", "not UTF-8", "deep", "single quotes", "two values"],
    )
    def test_not_json(self, content: bytes, place: Path) -> None:
        assert refused(place, content).message.startswith("this is not valid JSON: ")

    def test_too_large(self, place: Path, data: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
        content = json.dumps(data).encode()
        monkeypatch.setattr(chain_file, "_MOST_BYTES", len(content) - 1)
        assert "too large" in refused(place, content).message
        monkeypatch.setattr(chain_file, "_MOST_BYTES", len(content))
        load_chain(place)

    def test_cut_off_at_every_tenth_byte(self, data: dict[str, Any], place: Path) -> None:
        content = json.dumps(data).encode()
        assert len(content) > 5000
        for end in range(0, len(content), 10):
            assert refused(place, content[:end]).message.startswith("this is not valid JSON: ")

    @pytest.mark.parametrize("dotted", NEEDED)
    def test_each_key_that_is_needed(self, dotted: str, data: dict[str, Any], place: Path) -> None:
        with opened(data, as_path(dotted)) as (holder, key, whole):
            del holder[key]
        error = refused(place, whole)
        assert ("this is not a chain" if dotted == "schema" else f"'{key}'") in error.message or key == "kind"

    @pytest.mark.parametrize(
        ("dotted", "change"),
        [
            ("joints", lambda rows: rows[:-1]),
            ("joints", lambda rows: [*rows, rows[-1]]),
            ("joints", lambda rows: [row[:2] for row in rows]),
            ("joints", lambda rows: [rows[0][:2], *rows[1:]]),
            ("joints", lambda rows: rows[0]),
            ("joint_s", lambda row: row[:-1]),
            ("joint_s", lambda row: [row]),
            ("links", lambda rows: rows[:-1]),
            ("links", lambda _: []),
            ("links", lambda _: 3),
            ("links.0.transform", lambda rows: rows[:3]),
            ("links.0.length", lambda length: [length]),
            ("frame_transform", lambda rows: rows[:3]),
            ("skeleton.points", lambda rows: [row[:2] for row in rows]),
            ("skeleton.points", lambda rows: rows[0]),
            ("skeleton.basis.offset", lambda row: [*row, 0.0]),
            ("skeleton.basis.weights", lambda rows: [row[:2] for row in rows]),
            ("skeleton.basis.weights", lambda rows: rows[:-1]),
            ("skeleton.basis.size", lambda size: size + 1),
            ("skeleton.basis.kind", lambda _: "polynomial"),
            ("radius", lambda radius: [radius, radius]),
            ("radius", lambda _: None),
            ("radius", lambda _: 10**400),
            ("quality.findings.0.position", lambda row: row[:2]),
            ("quality.findings.0", lambda _: None),
            ("provenance", lambda _: []),
            ("provenance.config.r", lambda _: {"dof": 2}),
            ("provenance.config.joints", lambda _: []),
            ("provenance.config.material.mass", lambda _: -1.0),
            ("provenance.config.joints.dof", lambda _: 5),
            ("provenance.config.joints.zero", lambda _: "sideways"),
        ],
    )
    def test_wrong_shapes_and_values(
        self, dotted: str, change: Callable[[Any], Any], data: dict[str, Any], place: Path
    ) -> None:
        with opened(data, as_path(dotted)) as (holder, key, whole):
            holder[key] = change(holder[key])
        assert refused(place, whole).message.startswith("the chain is incomplete or damaged: ")

    @pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf")])
    @pytest.mark.parametrize(
        "dotted",
        [
            *("radius", "e_max", "max_deviation", "skeleton.length", "joints.1.2", "joint_s.1", "links.0.length"),
            *("links.0.transform.0.3", "frame_transform.3.3", "skeleton.points.2.0"),
            *("skeleton.basis.weights.1.1", "skeleton.basis.offset.0"),
        ],
    )
    def test_numbers_that_are_none(self, dotted: str, wrong: float, data: dict[str, Any], place: Path) -> None:
        with opened(data, as_path(dotted)) as (holder, key, whole):
            holder[key] = wrong
        assert "finite" in refused(place, whole).message

    def test_the_width_of_the_papers_functions(self, data: dict[str, Any], place: Path) -> None:
        with opened(data, ("skeleton", "basis", "kind")) as (basis, _, whole):
            basis.update(kind="inverse-quadratic", tau=5.25)
        place.write_text(json.dumps(whole))
        assert load_chain(place).skeleton.basis.to_dict()["tau"] == 5.25
        for wrong in (float("nan"), float("inf"), None):
            basis["tau"] = wrong
            refused(place, whole)
        del basis["tau"]
        assert "'tau'" in refused(place, whole).message

    @settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(draw=st.data())
    def test_anything_anywhere(self, draw: st.DataObject, data: dict[str, Any], place: Path) -> None:
        """A value that is missing or something else leads to an `InputError`, or to a chain; to nothing else."""
        path = draw.draw(st.sampled_from([path for path in paths_in(data) if len(path) < 3 or path[0] != "links"]))
        with opened(data, path) as (holder, key, whole):
            kind = draw.draw(st.sampled_from(["missing", "other", "shorter", "huge"]))
            if kind == "missing":
                del holder[key]
            elif kind == "shorter" and isinstance(holder[key], list):
                holder[key] = holder[key][: draw.draw(st.integers(0, 3))]
            else:
                holder[key] = 10**400 if kind == "huge" else draw.draw(ANYTHING)
        place.write_text(json.dumps(whole), encoding="utf-8")
        try:
            chain = load_chain(place)
        except InputError as error:
            assert error.hint
            return
        assert np.isfinite(chain.joints).all()
        with np.errstate(all="ignore"):  # numbers may be very large
            assert chain.skeleton(0.5).shape == (3,)
        assert chain.quality.verdict in ("good", "doubtful", "bad")
