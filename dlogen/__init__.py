"""dlogen: kinematic multibody models of deformable linear objects from point clouds.

>>> import dlogen
>>> cloud = dlogen.synth("bent", points=3000, seed=2)     # or dlogen.read_cloud("cloud.ply")
>>> result = dlogen.fit(cloud.points, {"e_max": 0.01})     # (M, 3) array, metres
>>> result.chain.joints.shape                              # the paper's x_0 .. x_n
(25, 3)
>>> result.quality.verdict
'good'
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from dlogen._version import __version__

if TYPE_CHECKING:
    from dlogen.config.reader import load_config
    from dlogen.config.schema import Config
    from dlogen.errors import ConfigError, DlogenError, FitError, InputError, OutputError, UsageError
    from dlogen.evaluation.comparison import compare
    from dlogen.evaluation.synthetic import SyntheticCloud, synth
    from dlogen.geometry.curvature import curvature, tangent
    from dlogen.io.chain_file import LoadedChain, load_chain
    from dlogen.io.cloud_files import read_cloud, read_raw, write_cloud
    from dlogen.io.curves.curve import Curve, load_curve
    from dlogen.io.result import Result
    from dlogen.multibody.model import MultibodyModel, forward_kinematics
    from dlogen.pipeline import fit
    from dlogen.stages.extract import extract
    from dlogen.types import Chain, Cloud, Finding, RawCloud, Skeleton

#: Imported on first use: `dlogen --help` must not pay for numpy.
_HOME = {
    "Chain": "dlogen.types",
    "Cloud": "dlogen.types",
    "Config": "dlogen.config.schema",
    "ConfigError": "dlogen.errors",
    "Curve": "dlogen.io.curves.curve",
    "DlogenError": "dlogen.errors",
    "Finding": "dlogen.types",
    "FitError": "dlogen.errors",
    "InputError": "dlogen.errors",
    "LoadedChain": "dlogen.io.chain_file",
    "MultibodyModel": "dlogen.multibody.model",
    "OutputError": "dlogen.errors",
    "RawCloud": "dlogen.types",
    "Result": "dlogen.io.result",
    "Skeleton": "dlogen.types",
    "SyntheticCloud": "dlogen.evaluation.synthetic",
    "UsageError": "dlogen.errors",
    "compare": "dlogen.evaluation.comparison",
    "curvature": "dlogen.geometry.curvature",
    "extract": "dlogen.stages.extract",
    "fit": "dlogen.pipeline",
    "forward_kinematics": "dlogen.multibody.model",
    "load_chain": "dlogen.io.chain_file",
    "load_config": "dlogen.config.reader",
    "load_curve": "dlogen.io.curves.curve",
    "read_cloud": "dlogen.io.cloud_files",
    "read_raw": "dlogen.io.cloud_files",
    "synth": "dlogen.evaluation.synthetic",
    "tangent": "dlogen.geometry.curvature",
    "write_cloud": "dlogen.io.cloud_files",
}

__all__ = [
    "Chain",
    "Cloud",
    "Config",
    "ConfigError",
    "Curve",
    "DlogenError",
    "Finding",
    "FitError",
    "InputError",
    "LoadedChain",
    "MultibodyModel",
    "OutputError",
    "RawCloud",
    "Result",
    "Skeleton",
    "SyntheticCloud",
    "UsageError",
    "__version__",
    "compare",
    "curvature",
    "extract",
    "fit",
    "forward_kinematics",
    "load_chain",
    "load_config",
    "load_curve",
    "read_cloud",
    "read_raw",
    "synth",
    "tangent",
    "write_cloud",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    raise AttributeError(f"module 'dlogen' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
