"""The skeleton line as CSV, and the chain in few keys."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from dlogen.io.registry import model_format


def table(result) -> dict[str, np.ndarray]:
    (name, content), *others = model_format("csv").write(result, "cable").items()
    assert name == "cable.skeleton.csv" and not others
    rows = list(csv.reader(io.StringIO(content.decode())))
    assert len(rows) == 1001
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def test_csv_of_a_circle(circle, make_result) -> None:
    # (0.3 cos t, 0.3 sin t, 0), t from 0 to 2: everything is known.
    found = table(make_result(circle(0.3, 2.0), 0.02, 0.01))
    assert list(found) == ["s", "arc_length", "x", "y", "z", "tx", "ty", "tz", "curvature"]
    t = np.linspace(0, 2, 1000)
    assert found["s"] == pytest.approx(t / 2, abs=1e-12)
    assert found["arc_length"] == pytest.approx(0.3 * t, abs=1e-12)
    assert found["x"] == pytest.approx(0.3 * np.cos(t), abs=1e-12)
    assert found["y"] == pytest.approx(0.3 * np.sin(t), abs=1e-12)
    assert np.abs(found["z"]).max() == 0
    assert found["tx"] == pytest.approx(-np.sin(t), abs=1e-12)
    assert found["ty"] == pytest.approx(np.cos(t), abs=1e-12)
    assert found["tz"] == pytest.approx(np.zeros(1000), abs=1e-12)
    assert found["curvature"] == pytest.approx(np.full(1000, 1 / 0.3), rel=1e-12)


def test_csv_is_even_in_arc_length_where_the_parameter_is_not(exact_line, make_result) -> None:
    def parabola(s: np.ndarray, derivative: int) -> np.ndarray:
        x = 2 * s - 1
        y = (x**2, 4 * x, np.full_like(s, 8.0))[derivative]
        return np.stack([(x, np.full_like(s, 2.0), 0 * s)[derivative], y, 0 * s], axis=-1)

    result = make_result(exact_line(parabola), 0.02, 0.01)
    found = table(result)
    points = np.stack([found[axis] for axis in "xyz"], axis=1)
    assert points == pytest.approx(result.skeleton_points, abs=0)
    assert points[:, 1] == pytest.approx(points[:, 0] ** 2, abs=1e-12)
    assert points == pytest.approx(result.skeleton(found["s"]), abs=1e-12)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps == pytest.approx(np.full(999, found["arc_length"][1]), rel=1e-5)
    assert found["curvature"] == pytest.approx(2 / (1 + 4 * points[:, 0] ** 2) ** 1.5, rel=1e-9)
    assert found["tx"] ** 2 + found["ty"] ** 2 == pytest.approx(np.ones(1000))
    assert found["ty"] / found["tx"] == pytest.approx(2 * points[:, 0], abs=1e-9)


def test_csv_is_a_curve_for_compare(tmp_path, circle, make_result) -> None:
    from dlogen.io.curves.curve import load_curve

    result = make_result(circle(0.3, 2.0), 0.02, 0.01)
    for name, content in model_format("csv").write(result, "cable").items():
        (tmp_path / name).write_bytes(content)
        assert np.array_equal(load_curve(tmp_path / name).points, result.skeleton_points)


def test_plain_json(circle, make_result) -> None:
    result = make_result(circle(0.3, 2.0), 0.02, 0.01)
    (name, content), *others = model_format("json-plain").write(result, "cable").items()
    assert name == "cable.plain.json" and not others
    data = json.loads(content)
    assert list(data) == ["schema", "name", "frame", "radius", "joints", "lengths"]
    assert data["schema"] == "dlogen.plain/1"
    assert data["name"] == "cable"
    assert data["radius"] == 0.02
    joints = np.array(data["joints"])
    assert joints.tolist() == result.chain.joints.tolist()
    assert data["lengths"] == pytest.approx(np.linalg.norm(np.diff(joints, axis=0), axis=1), abs=1e-12)
