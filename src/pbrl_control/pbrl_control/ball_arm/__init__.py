"""An arm that pushes what is on a table with a ball (thesis 3.1.4)."""

from pbrl_control.ball_arm.arm import JOINTS, BallArm, Place
from pbrl_control.ball_arm.strokes import Stroke, Strokes, StrokeSettings

__all__ = ["JOINTS", "BallArm", "Place", "Stroke", "StrokeSettings", "Strokes"]
