"""A grasp that gives."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain

PARAMETERS = (plain("grip_compliance", 0.0, 5e-4), plain("grip_play", 0.0, 5e-3))
"""No scene scales them."""


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return PARAMETERS


EFFECT = Effect(
    name="grasp_compliance",
    summary="The gripper's hold gives: a spring and damper, or play, between gripper and object.",
    equation="p_gripper - p_contact = C f + p f / |f| in the body's axes",
    shows=(
        "Squeeze hard in both directions at rest. The motion of the body alone does not show it where the "
        "wrist's force is known: it shows between the gripper's pose and the object's."
    ),
    parameters=parameters,
    variants=(
        (
            "grip_compliance",
            "grip_play",
        ),
    ),
    direction="gripper",
)
