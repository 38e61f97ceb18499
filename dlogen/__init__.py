"""dlogen: kinematic multibody models of deformable linear objects from point clouds.

>>> import dlogen
>>> result = dlogen.fit(points)                    # (M, 3) array, metres
>>> result.chain.joints                            # (n + 1, 3)
"""

from __future__ import annotations

import importlib
from typing import Any

from dlogen._version import __version__

# Imported on first use: `dlogen --help` must not pay for numpy.
_PUBLIC = {
    "fit": "dlogen.pipeline",
    "Result": "dlogen.types",
    "Cloud": "dlogen.types",
    "Config": "dlogen.config.schema",
    "load_config": "dlogen.config.schema",
    "read_cloud": "dlogen.io.cloud_files",
    "write_cloud": "dlogen.io.cloud_files",
    "load_curve": "dlogen.io.curves.curve",
    "compare": "dlogen.evaluation.comparison",
    "DlogenError": "dlogen.errors",
}

__all__ = [*_PUBLIC, "__version__"]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'dlogen' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
