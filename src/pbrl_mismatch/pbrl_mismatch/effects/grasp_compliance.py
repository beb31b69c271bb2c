"""A grasp that gives."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("grip_compliance", 3e-4, 1.2),
        positive("grip_turn", 3e-3, 1.2),
    )


EFFECT = Effect(
    name="grasp_compliance",
    summary="The gripper's hold gives: a spring and damper, or play, between gripper and object.",
    equation="p_gripper - p_contact = C f in the body's axes",
    shows=(
        "Squeeze hard in both directions at rest. The motion of the body alone does not show it where the "
        "wrist's force is known: it shows between the gripper's pose and the object's."
    ),
    parameters=parameters,
    variants=(
        (
            "grip_compliance",
            "grip_turn",
        ),
    ),
    direction="gripper",
)
