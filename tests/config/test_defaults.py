"""Defaults that are needed beside the declarations: each is what happens, what `auto` says, and what is configured."""

from __future__ import annotations

import inspect
import subprocess
import sys

import numpy as np
import pytest
from configurations import KEYS

from dlogen.config import defaults
from dlogen.config.schema import Config
from dlogen.config.sections import FrameSettings, Material
from dlogen.evaluation.comparison import compare
from dlogen.multibody.build import build_model
from dlogen.multibody.materials import properties
from dlogen.stages.output_frame import output_frame
from dlogen.stages.paper.skeleton import paper_basis
from dlogen.stages.segmentation.specification import SegmentationSpec, allowed_deviation
from dlogen.types import Cloud


def auto(key: str) -> str:
    """What the help says of `auto`."""
    return KEYS.settings[key].auto or ""


def test_they_cost_no_imports():
    code = "import sys, dlogen.config.defaults; print([*{'dataclasses', 'numpy', 'yaml'} & {*sys.modules}])"
    out = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_basis_of_the_paper():
    assert auto("skeleton.tau").startswith("N / 4,")
    assert (paper_basis().size, paper_basis().tau) == (21, 5.25)
    assert (paper_basis().size, paper_basis(40).tau) == (defaults.PAPER_SIZE, 40 / defaults.N_PER_TAU)


def test_deviation():
    assert auto("e_max") == "r / 2, the paper's ratio"
    assert allowed_deviation(Config(), 0.02) == 0.02 / defaults.R_PER_E_MAX == 0.01  # Table III


def test_samples_of_mdtw():
    assert Config().mdtw.samples == defaults.MDTW_SAMPLES == 1000  # Table II
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert compare(line, line)["samples"] == 1000


def test_segmentation():
    assert Config().segmentation.placement == defaults.PLACEMENT == "on-curve"
    assert Config().segmentation.min_last == defaults.MIN_LAST == 0.5
    spec = SegmentationSpec()
    assert (spec.placement, spec.min_last) == ("on-curve", 0.5)
    assert SegmentationSpec.of(Config()) == spec


def test_material():
    made = properties(Material(youngs_modulus=1e6, poissons_ratio=0.3), 0.01, 1.0)
    assert made.name == "generic" == auto("material.name").split()[-1]
    assert made.mass_per_length / made.area == pytest.approx(1200)
    assert auto("material.density").endswith("else 1200")
    assert made.damping_ratio == 0.05
    assert "else 0.05;" in auto("material.damping_ratio")


def test_frames():
    assert auto("frame.name") == "cloud in the chain, base_link in the models"
    assert output_frame(FrameSettings(), Cloud(np.zeros((1, 3)))).name == "cloud"
    assert inspect.signature(build_model).parameters["root"].default == "base_link"
