"""Force sensor scaled or turned."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("force_scale", 1.0, 0.25),
        plain("sensor_turn", 0.0, 0.3),
    )


EFFECT = Effect(
    name="wrench_frame",
    summary="The force sensor reads a scaled or turned wrench.",
    equation="felt = s R(a) true in the sensor's axes",
    shows="Push along different directions of the gripper. Its scale is the mass's, unless that is known.",
    parameters=parameters,
    variants=(
        (
            "force_scale",
            "sensor_turn",
        ),
        ("force_scale",),
        ("sensor_turn",),
    ),
    fixed={"torque_scale": -1.0},
    direction="gripper",
    exact=True,
)
