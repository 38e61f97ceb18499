from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dlogen.geometry.mdtw import mdtw
from dlogen.types import Mdtw

coordinates = st.floats(-10, 10, allow_nan=False, width=32)


def curves(largest: int) -> st.SearchStrategy[np.ndarray]:
    return st.integers(1, largest).flatmap(lambda k: hnp.arrays(float, (k, 3), elements=coordinates))


def bent(s: np.ndarray) -> np.ndarray:
    return np.c_[np.sin(np.pi * s), 2 * np.cos(np.pi * s) - 1, 0 * s]


def helical(s: np.ndarray) -> np.ndarray:
    return np.c_[0.5 * np.sin(3 * np.pi * s), 0.5 * np.cos(3 * np.pi * s), 0.5 * s]


def total(result: Mdtw) -> float:
    return float(result.error.sum())


def least_by_trying_all_paths(v: np.ndarray, q: np.ndarray) -> float:
    def rest(i: int, j: int) -> float:
        here = math.dist(v[i], q[j])
        after = [
            rest(i + a, j + b) for a, b in ((1, 1), (1, 0), (0, 1)) if i + a < len(v) and j + b < len(q)
        ]  # every path is walked: nothing of the dynamic programme is used here
        return here + min(after, default=0.0)

    return rest(0, 0)


@settings(deadline=None)
@given(curves(5), curves(5))
def test_no_path_is_better(v: np.ndarray, q: np.ndarray) -> None:
    assert total(mdtw(v, q)) == pytest.approx(least_by_trying_all_paths(v, q), abs=1e-9)


@settings(deadline=None)
@given(curves(40), curves(40))
def test_the_path_is_a_warping_path_and_the_errors_are_its_distances(v: np.ndarray, q: np.ndarray) -> None:
    result = mdtw(v, q)
    assert result.path[0].tolist() == [0, 0]
    assert result.path[-1].tolist() == [len(v) - 1, len(q) - 1]
    assert {tuple(step) for step in np.diff(result.path, axis=0)} <= {(0, 1), (1, 0), (1, 1)}
    i, j = result.path.T
    assert result.error == pytest.approx(np.linalg.norm(v[i] - q[j], axis=1))
    assert result.s == pytest.approx(i / max(len(v) - 1, 1))
    assert result.mean == pytest.approx(result.error.mean())
    assert result.max == result.error.max()
    deviations = result.error - result.error.mean()
    assert result.std == pytest.approx(math.sqrt((deviations**2).sum() / max(len(i) - 1, 1)), abs=1e-12)


@settings(deadline=None, max_examples=50)
@given(curves(30), curves(30))
def test_against_similaritymeasures(v: np.ndarray, q: np.ndarray) -> None:
    similaritymeasures = pytest.importorskip("similaritymeasures")
    expected, _ = similaritymeasures.dtw(v, q)
    assert total(mdtw(v, q)) == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=50)
@given(curves(30), curves(30))
def test_against_dtw_python(v: np.ndarray, q: np.ndarray) -> None:
    dtw = pytest.importorskip("dtw")
    expected = dtw.dtw(v, q, dist_method="euclidean", step_pattern="symmetric1").distance
    assert total(mdtw(v, q)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("h", "g"), [(1000, 1000), (700, 1000), (1000, 30)])
def test_against_similaritymeasures_at_full_size(h: int, g: int) -> None:
    similaritymeasures = pytest.importorskip("similaritymeasures")
    noise = np.random.default_rng(7).normal(0, 1e-3, (g, 3))
    v, q = bent(np.linspace(0, 1, h)), bent(np.linspace(0.01, 0.98, g) ** 1.1) + noise
    expected, cumulative = similaritymeasures.dtw(v, q)
    result = mdtw(v, q)
    assert total(result) == pytest.approx(expected, abs=1e-9)
    # The whole path is a best one: at every pair the sum so far is the least possible.
    i, j = result.path.T
    assert np.cumsum(result.error) == pytest.approx(cumulative[i, j], abs=1e-9)


def path_by_the_full_matrix(v: np.ndarray, q: np.ndarray) -> list[list[int]]:
    squares = sum((v[:, None, c] - q[None, :, c]) ** 2 for c in range(v.shape[1]))
    distance, sums = np.sqrt(squares).tolist(), {(-1, -1): 0.0}

    def before(i: int, j: int) -> tuple[float, int, int]:
        # In the order of the tie rule; of equally small ones min() takes the first.
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        return min(((sums.get(pair, math.inf), *pair) for pair in steps), key=lambda step: step[0])

    for i in range(len(v)):
        for j in range(len(q)):
            sums[i, j] = before(i, j)[0] + distance[i][j]
    path = [[len(v) - 1, len(q) - 1]]
    while path[-1] != [0, 0]:
        path.append(list(before(*path[-1])[1:]))
    return path[::-1]


@settings(deadline=None, max_examples=60)
@given(st.data(), st.integers(72, 110), st.integers(72, 110), st.integers(0, 10**6))
def test_the_band_holds_the_path_of_the_full_matrix(data: st.DataObject, h: int, g: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    walk = rng.normal(size=(h, 3)).cumsum(axis=0)
    at = np.linspace(0, 1, g) ** data.draw(st.floats(0.5, 2))
    other = np.stack([np.interp(at, np.linspace(0, 1, h), column) for column in walk.T], axis=1)
    other += data.draw(st.sampled_from([0.0, 1e-9, 0.1, 1.0, 10.0])) * rng.normal(size=other.shape)
    if data.draw(st.booleans()):
        walk, other = np.round(walk), np.round(other)  # many paths are equally short
    assert mdtw(walk, other).path.tolist() == path_by_the_full_matrix(walk, other)


whole = st.integers(0, 2).map(float)


@pytest.mark.parametrize(("first", "wider", "at_once"), [(1, 2, 1), (1, 3, 7), (2, 3, 100)])
def test_narrow_bands_are_widened_until_they_hold_the_path(
    monkeypatch: pytest.MonkeyPatch, first: int, wider: int, at_once: int
) -> None:
    module = sys.modules["dlogen.geometry.mdtw"]
    monkeypatch.setattr(module, "_FIRST_BAND", first)
    monkeypatch.setattr(module, "_WIDER", wider)
    monkeypatch.setattr(module, "_AT_ONCE", at_once)
    lengths = st.tuples(st.integers(1, 14), st.integers(1, 14))

    @settings(deadline=None)
    @given(lengths.flatmap(lambda n: st.tuples(*(hnp.arrays(float, (k, 1), elements=whole) for k in n))))
    def same(pair: tuple[np.ndarray, np.ndarray]) -> None:
        assert mdtw(*pair).path.tolist() == path_by_the_full_matrix(*pair)

    same()


def test_the_edge_of_the_band_shows_what_is_beyond_it() -> None:
    # Far from the diagonal there is a path that costs nothing: half of one curve is a pause of the other.
    s = np.linspace(0, 1, 300)
    early, late = np.append(np.zeros(300), s), np.append(s, np.ones(300))
    v, q = np.c_[early, 0 * early, 0 * early], np.c_[late, 0 * late, 0 * late]
    result = mdtw(v, q)
    assert result.max == 0.0
    assert np.abs(np.subtract(*result.path.T)).max() >= 298


@settings(deadline=None)
@given(curves(25), curves(25))
def test_the_sum_is_symmetric_under_exchange(v: np.ndarray, q: np.ndarray) -> None:
    assert total(mdtw(v, q)) == pytest.approx(total(mdtw(q, v)), abs=1e-9)


@settings(deadline=None)
@given(curves(25), curves(25))
def test_the_sum_is_that_of_both_curves_backwards(v: np.ndarray, q: np.ndarray) -> None:
    assert total(mdtw(v, q)) == pytest.approx(total(mdtw(v[::-1], q[::-1])), abs=1e-9)


@settings(deadline=None)
@given(curves(25), curves(25), st.integers(0, 10**6))
def test_the_sum_does_not_depend_on_the_frame(v: np.ndarray, q: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shift = rng.normal(size=3)
    assert total(mdtw(v @ rotation.T + shift, q @ rotation.T + shift)) == pytest.approx(total(mdtw(v, q)), abs=1e-9)


@given(curves(50))
def test_a_curve_and_itself(v: np.ndarray) -> None:
    result = mdtw(v, v)
    assert (result.mean, result.std, result.max) == (0.0, 0.0, 0.0)
    # The tie rule: the diagonal, even where points repeat.
    assert np.array_equal(result.path, np.repeat(np.arange(len(v))[:, None], 2, axis=1))


def test_a_known_offset_and_unit() -> None:
    line = np.c_[np.linspace(0, 1, 100), np.zeros((100, 2))]
    result = mdtw(line, line + np.array([0, 0, 0.004]))
    assert (result.mean, result.std, result.max) == pytest.approx((0.004, 0.0, 0.004), abs=1e-15)
    assert len(result.path) == 100


def test_by_hand() -> None:
    v = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    q = np.array([[0.0, 1, 0], [2, 0, 0]])
    result = mdtw(v, q)
    assert result.path.tolist() == [[0, 0], [1, 1], [2, 1]]
    assert result.error == pytest.approx([1, 1, 0])
    assert result.s == pytest.approx([0, 0.5, 1])
    assert (result.mean, result.std, result.max) == pytest.approx((2 / 3, math.sqrt(1 / 3), 1))


def test_tie_rule() -> None:
    # All points coincide, so all paths cost nothing: diagonals first, seen from the far end.
    assert mdtw(np.zeros((3, 3)), np.zeros((5, 3))).path.tolist() == [[0, 0], [0, 1], [0, 2], [1, 3], [2, 4]]
    assert mdtw(np.zeros((4, 3)), np.zeros((2, 3))).path.tolist() == [[0, 0], [1, 0], [2, 0], [3, 1]]
    # (0, 1) and (1, 0) cost nothing, (1, 1) does; a diagonal would leave them out. Without one, v moves last.
    v, q = np.array([[0.0], [0], [9]]), np.array([[0.0], [0], [9]])
    assert mdtw(v, q).path.tolist() == [[0, 0], [1, 1], [2, 2]]


def test_single_points() -> None:
    one = mdtw([[0.0, 0, 0]], [[3.0, 4, 0]])
    assert (one.mean, one.std, one.max, one.path.tolist(), one.s.tolist()) == (5.0, 0.0, 5.0, [[0, 0]], [0.0])
    line = np.c_[np.arange(4.0), np.zeros((4, 2))]
    assert mdtw(line, line[:1]).path.tolist() == [[i, 0] for i in range(4)]
    assert mdtw(line[:1], line).path.tolist() == [[0, i] for i in range(4)]
    assert mdtw(line, line[:1]).error == pytest.approx([0, 1, 2, 3])


@pytest.mark.parametrize("count", [200, 2000])
def test_the_standard_deviation_is_one_for_any_number_of_samples(count: int) -> None:
    # Errors 0.01 |sin|: sqrt(1/2 - 4 / pi^2). The formula printed in the paper grows with the square root of K.
    s = np.linspace(0, 1, count)
    line = np.c_[s, 0 * s, 0 * s]
    result = mdtw(line, line + 0.01 * np.c_[0 * s, np.sin(2 * np.pi * s), 0 * s])
    assert result.mean == pytest.approx(0.02 / np.pi, rel=0.01)
    assert result.std == pytest.approx(0.01 * math.sqrt(0.5 - 4 / np.pi**2), rel=0.02)


@pytest.mark.parametrize(
    "bad", [np.empty((0, 3)), np.zeros(3), np.empty((3, 0)), np.full((2, 3), np.nan), [[np.inf, 0, 0]]]
)
def test_what_is_not_a_curve_is_refused(bad: np.ndarray) -> None:
    good = np.zeros((2, 3))
    for first, second, which in ((bad, good, "first"), (good, bad, "second")):
        with pytest.raises(ValueError, match=which):
            mdtw(first, second)


def test_different_dimensions_are_refused() -> None:
    with pytest.raises(ValueError, match="3 and 2"):
        mdtw(np.zeros((2, 3)), np.zeros((2, 2)))


def test_memory_is_one_byte_per_pair() -> None:
    # 4,000 x 4,000 pairs: 16 MB of steps, where a float64 matrix would take 128 MB.
    code = (
        "import resource, numpy as np; from dlogen.geometry.mdtw import mdtw;"
        "v = np.random.default_rng(0).normal(size=(4000, 3)).cumsum(axis=0); mdtw(v[:10], v);"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss; mdtw(v, v + 1);"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    pytest.importorskip("resource")
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    unit = 1 if sys.platform == "darwin" else 1024
    assert int(out.stdout) * unit < 40e6
