"""Force sensor offset or drift."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        plain("bias_x", 0.0, 4.0),
        plain("bias_y", 0.0, 4.0),
        plain("bias_torque", 0.0, 1.0),
        plain("bias_start", scene.start + 0.4 * scene.seconds, 0.3 * scene.seconds),
        plain("drift_x", 0.0, 0.3),
        plain("drift_y", 0.0, 0.3),
        plain("drift_torque", 0.0, 0.075),
    )


EFFECT = Effect(
    name="wrench_bias",
    summary="The force sensor reads an offset, or one that drifts.",
    equation="felt = true + b or b [t > t_0] or d (t - t_rest), in the sensor's axes, read at rest at t_rest",
    shows="A force that is constant in the gripper's axes: turn the body.",
    parameters=parameters,
    variants=(
        (
            "bias_x",
            "bias_y",
            "bias_torque",
        ),
        (
            "bias_x",
            "bias_y",
            "bias_torque",
            "bias_start",
        ),
        (
            "drift_x",
            "drift_y",
            "drift_torque",
        ),
    ),
    direction="gripper",
    moments=("bias_start",),
    linear=("bias_x", "bias_y", "bias_torque", "drift_x", "drift_y", "drift_torque"),
    exact=True,
)
