from __future__ import annotations

import json
import math

import numpy as np
import pytest

from dlogen.evaluation.shapes import centre_line, hose_centre_line, random_centre_line
from dlogen.geometry.basis import CubicBSpline, InverseQuadratic
from dlogen.io.models.chain import write
from dlogen.io.registry import model_format
from dlogen.types import Finding, Quality

#: Every key of the contract, by the file's place of it.
KEYS = {
    "": "schema units frame profile radius skeleton segment_count segment_length last_segment_length length e_max "
    "max_deviation joints links quality provenance",
    "skeleton": "length points basis",
    "quality": "verdict findings",
}


def read(result, stem: str = "cable") -> dict:
    (name, content), *others = write(result, stem).items()
    assert name == f"{stem}.json"
    assert not others

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} in JSON")

    return json.loads(content.decode(), parse_constant=refuse)


@pytest.fixture(scope="module")
def data(fitted, make_result) -> dict:
    return read(make_result(fitted(hose_centre_line()), 0.02, 0.01))


def evaluate(basis: dict, s: np.ndarray) -> np.ndarray:
    """f(s) from what the file says alone, by the textbook."""
    weights, offset = np.array(basis["weights"]), np.array(basis["offset"])
    n = basis["size"]
    assert weights.shape == (n, 3)
    if basis["kind"] == "inverse-quadratic":
        centres = np.arange(n) / (n - 1)
        phi = 1 / (1 + basis["tau"] ** 2 * (s[:, None] - centres) ** 2)
    else:
        assert basis["kind"] == "cubic-b-spline"
        knots = np.arange(-3, n + 1) / (n - 3)

        def bspline(i: int, degree: int) -> np.ndarray:  # Cox-de Boor
            if degree == 0:
                return ((knots[i] <= s) & (s < knots[i + 1])).astype(float)
            rising = (s - knots[i]) / (knots[i + degree] - knots[i])
            falling = (knots[i + degree + 1] - s) / (knots[i + degree + 1] - knots[i + 1])
            return rising * bspline(i, degree - 1) + falling * bspline(i + 1, degree - 1)

        phi = np.stack([bspline(i, 3) for i in range(n)], axis=1)
    return phi @ weights + offset


def test_it_is_registered() -> None:
    assert model_format("json").write is write


@pytest.mark.parametrize("place", KEYS)
def test_the_keys_of_the_contract(data, place: str) -> None:
    part = data[place] if place else data
    assert set(KEYS[place].split()) <= set(part)
    assert data["schema"] == "dlogen.chain/1"


def test_shapes_and_values(data, fitted, make_result) -> None:
    result = make_result(fitted(hose_centre_line()), 0.02, 0.01)
    n = data["segment_count"]
    assert n == len(data["links"]) == len(data["joints"]) - 1 == len(result.chain.lengths)
    assert data["radius"] == 0.02
    assert data["e_max"] == 0.01
    assert data["joints"] == result.chain.joints.tolist()  # all digits
    assert data["skeleton"]["length"] == pytest.approx(1.7, abs=1e-6)
    assert data["skeleton"]["length"] == result.skeleton.length
    assert data["max_deviation"] == result.max_deviation < 0.0101


def test_the_lengths_are_those_of_the_joints(data) -> None:
    joints = np.array(data["joints"])
    lengths = np.linalg.norm(np.diff(joints, axis=0), axis=1)
    assert [link["length"] for link in data["links"]] == pytest.approx(lengths, abs=1e-12)
    assert lengths[:-1] == pytest.approx(np.full(len(lengths) - 1, data["segment_length"]), abs=1e-9)
    assert lengths[-1] == pytest.approx(data["last_segment_length"], abs=1e-9)
    assert data["length"] == pytest.approx(lengths.sum())


def test_links_lie_between_their_joints(data) -> None:
    joints = np.array(data["joints"])
    for i, link in enumerate(data["links"]):
        transform = np.array(link["transform"])  # rows
        assert transform[3].tolist() == [0, 0, 0, 1]
        half = [link["length"] / 2, 0, 0, 1]
        assert (transform @ half)[:3] == pytest.approx(joints[i + 1], abs=1e-12)
        assert (transform @ [-half[0], 0, 0, 1])[:3] == pytest.approx(joints[i], abs=1e-12)
        assert np.linalg.det(transform[:3, :3]) == pytest.approx(1)
        assert link["name"] == f"segment_{i + 1:02d}"


@pytest.mark.parametrize("basis", [CubicBSpline(40), CubicBSpline(4), InverseQuadratic(21, 5.25)], ids=repr)
def test_the_skeleton_can_be_evaluated_again(exact_line, fitted, make_result, basis) -> None:
    from dataclasses import replace

    line = fitted(random_centre_line(8), basis)
    line = replace(line, offset=np.array([3.0, -2.0, 0.5]))
    skeleton = read(make_result(line, 0.02, 0.01))["skeleton"]
    points = np.array(skeleton["points"])
    assert points.shape == (1000, 3)
    # At the joints' s, and at s found from even arc length by brute force.
    fine = np.linspace(0, 1, 50_001)
    curve = evaluate(skeleton["basis"], fine)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    assert along[-1] == pytest.approx(skeleton["length"], rel=1e-7)
    s = np.interp(np.linspace(0, along[-1], 1000), along, fine)
    assert evaluate(skeleton["basis"], s) == pytest.approx(points, abs=1e-6)


def test_joints_lie_on_the_skeleton_at_their_s(data) -> None:
    found = evaluate(data["skeleton"]["basis"], np.array(data["joint_s"]))
    assert found == pytest.approx(np.array(data["joints"]), abs=1e-12)


def test_skeleton_points_are_even_in_arc_length(data) -> None:
    steps = np.linalg.norm(np.diff(np.array(data["skeleton"]["points"]), axis=0), axis=1)
    assert steps == pytest.approx(np.full(999, data["skeleton"]["length"] / 999), rel=1e-5)


def test_findings(fitted, make_result) -> None:
    findings = (
        Finding("gap", "no points over 84 mm", "doubtful", 0.25, (1.0, 2.0, 3.0)),
        Finding("radius", "it is 2 cm", "note"),
    )
    quality = read(make_result(fitted(hose_centre_line()), quality=Quality(findings)))["quality"]
    assert quality["verdict"] == "doubtful"
    assert quality["findings"] == [
        {"code": "gap", "message": "no points over 84 mm", "severity": "doubtful", "s": 0.25, "position": [1, 2, 3]},
        {"code": "radius", "message": "it is 2 cm", "severity": "note"},
    ]


def test_a_straight_line_has_finite_numbers_only(fitted, make_result, straight) -> None:
    # One segment, no curvature, infinite allowed length: read() refuses NaN and Infinity.
    data = read(make_result(fitted(straight([0, 0, 0], [1, 0, 0])), 0.01))
    assert all(math.isfinite(data[key]) for key in ("segment_length", "last_segment_length", "max_deviation"))


def test_far_from_the_origin(fitted, make_result) -> None:
    line = fitted(random_centre_line(8))
    moved = type(line)(line.basis, line.weights, np.array([5e6, -4e6, 300.0]), line.length)
    here, there = read(make_result(line)), read(make_result(moved))
    assert there["segment_count"] == here["segment_count"]
    shift = np.array(there["joints"]) - np.array(here["joints"])
    assert shift == pytest.approx(np.tile([5e6, -4e6, 300.0], (len(shift), 1)), rel=0, abs=1e-6)


def test_the_same_result_gives_the_same_bytes(fitted, make_result) -> None:
    first, second = (write(make_result(fitted(centre_line("helical"))), "x") for _ in range(2))
    assert first == second


def test_any_name_can_be_written(fitted, make_result) -> None:
    result = make_result(fitted(hose_centre_line()), provenance={"input": 'größe "線".ply', "points": 1})
    assert read(result, "größe-線")["provenance"]["input"] == 'größe "線".ply'
