"""What of a percept cannot be relied upon, in words."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.cart.percept import CartPercept, Cause
from pbrl_control.cart.settings import CartSettings

SIDES = ("left", "right")


def grip_fault(percept: CartPercept, settings: CartSettings) -> str:
    """Return why the cart is not held as it should be; empty where it is."""
    lost = [side for side, holds in zip(SIDES, percept.holds, strict=True) if not holds]
    if len(lost) == 2:
        return "grip: expected both hands on the cart, neither holds it; take it again"
    if lost:
        return f"grip: expected both hands on the cart, the {lost[0]} one has lost it; take it again"
    if abs(percept.misfit) > settings.misfit:
        return (
            f"grip: expected the hands within {settings.misfit:g} m of where they took hold, are "
            f"{abs(percept.misfit):.3f} m off; take the cart again"
        )
    off = math.hypot(*percept.grip_offset)
    if not off <= settings.grip_off:
        return f"grip: expected within {settings.grip_off:g} m of its place, is {off:.3f} m away; take the cart again"
    return ""


def stale_fault(percept: CartPercept, now: float, settings: CartSettings) -> tuple[Cause, str]:
    """Return what is too old or no number, and in words; `Cause.NONE` where nothing is."""
    pose, angle = percept.pose, percept.articulation
    if pose is None or np.shape(pose) != (3,) or not np.isfinite(pose).all():
        return Cause.POSE, "pose of the base: expected finite x, y, theta, got none"
    if angle is None or not math.isfinite(angle):
        return Cause.ARTICULATION, "pose of the cart: expected a finite articulation, got none"
    ages = {
        Cause.POSE: settings.pose_age,
        Cause.ARTICULATION: settings.articulation_age,
        Cause.SCAN: settings.scan_age,
        Cause.JOINTS: settings.joints_age,
    }
    for cause, what, time in percept.streams:
        age, most = now - time, ages[cause]
        if not 0.0 <= age <= most:
            return cause, f"{what}: expected one at most {most:g} s old, the last is {age:.2f} s old"
    return Cause.NONE, ""
