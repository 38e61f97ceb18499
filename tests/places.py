"""Where things are, for tests in whatever folder."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]
SAMPLES = ROOT / "sample_clouds"
#: Real clouds that are not part of the project; tests skip where they are missing.
DATA = Path(os.environ.get("DLOGEN_TEST_DATA", ROOT.parent / "shared" / "data"))
