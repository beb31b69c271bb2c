"""Puts the rooms and the kinematic base of the navigation tests within reach of these."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "navigation"))
