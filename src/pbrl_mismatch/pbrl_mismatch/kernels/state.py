"""What moves in a model: the body's six numbers, then what else there is."""

from __future__ import annotations

CASTERS, FIRST_CASTER, SLOSH, UNSEEN, STATE = 8, 6, 14, 18, 21
"""Casters at most; where the headings, the load's swing and the unseen body's pose stand in a state; its length."""
