"""A chain that was written and is read again is the chain that it was."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dlogen.errors import InputError
from dlogen.io.chain_file import load_chain
from dlogen.io.models import chain as chain_json


@pytest.fixture(scope="module")
def result(fitted, helix, make_result):
    return make_result(fitted(helix(0.3, 0.05, 7.0)), 0.01)


@pytest.fixture
def path(result, tmp_path: Path) -> Path:
    (content,) = chain_json.write(result, "cable").values()
    (tmp_path / "cable.json").write_bytes(content)
    return tmp_path / "cable.json"


def test_everything_comes_back(result, path: Path) -> None:
    chain = load_chain(path)
    assert (chain.name, chain.profile, chain.frame.name) == ("cable", "paper", "cloud")
    assert np.array_equal(chain.chain.joints, result.chain.joints)
    assert np.array_equal(chain.chain.transforms, result.chain.transforms)
    assert chain.chain.lengths == pytest.approx(result.chain.lengths)
    assert chain.chain.radius == result.chain.radius
    assert np.array_equal(chain.skeleton_points, result.skeleton_points)
    s = np.linspace(0.0, 1.0, 77)
    assert chain.skeleton(s) == pytest.approx(result.skeleton(s), abs=1e-12)
    assert chain.skeleton(s, 1) == pytest.approx(result.skeleton(s, 1), abs=1e-9)
    assert (chain.e_max, chain.max_deviation) == (result.e_max, result.max_deviation)
    assert chain.quality == result.quality


def test_what_is_no_chain_is_refused(path: Path) -> None:
    content = json.loads(path.read_text())
    for damaged in ("", "{", "[]", json.dumps(content | {"schema": "dlogen.chain/9"}), json.dumps({"schema": "x"})):
        path.write_text(damaged)
        with pytest.raises(InputError) as caught:
            load_chain(path)
        assert caught.value.hint
    del content["joints"]
    path.write_text(json.dumps(content))
    with pytest.raises(InputError):
        load_chain(path)
    with pytest.raises(InputError):
        load_chain(path.with_name("none.json"))
