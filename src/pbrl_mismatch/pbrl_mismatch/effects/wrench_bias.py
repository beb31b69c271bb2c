"""Force sensor offset or drift."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        plain("bias_x", 0.0, 4.0),
        plain("bias_y", 0.0, 4.0),
        plain("bias_torque", 0.0, 1.0),
        plain("drift_x", 0.0, 0.2),
        plain("drift_y", 0.0, 0.2),
        plain("drift_torque", 0.0, 0.05),
    )


EFFECT = Effect(
    name="wrench_bias",
    summary="The force sensor reads an offset, or one that drifts.",
    equation="felt = true + b + d t in the sensor's axes",
    shows="A force that is constant in the gripper's axes: turn the body.",
    parameters=parameters,
    variants=(
        (
            "bias_x",
            "bias_y",
            "bias_torque",
        ),
        (
            "drift_x",
            "drift_y",
            "drift_torque",
        ),
        (
            "bias_x",
            "bias_y",
            "bias_torque",
            "drift_x",
            "drift_y",
            "drift_torque",
        ),
    ),
    direction="gripper",
)
