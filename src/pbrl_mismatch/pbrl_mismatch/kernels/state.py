"""What moves in a model: the body's six numbers, then what else there is."""

from __future__ import annotations

CASTERS, FIRST_CASTER, SLOSH, UNSEEN, STATE = 8, 6, 22, 26, 32
"""Casters at most; where their directions (cosine and sine), the load's swing, the unseen body's pose and twist stand
in a state; its length."""
