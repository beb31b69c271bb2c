"""Tag glued on with an offset."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain

PARAMETERS = (plain("tag_x", 0.0, 0.06), plain("tag_y", 0.0, 0.06), plain("tag_theta", 0.0, 0.15))
"""No scene scales them."""


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return PARAMETERS


EFFECT = Effect(
    name="pose_bias",
    summary="The tag sits, or is turned, other than was told.",
    equation="seen = true pose, moved by b in the body's frame and turned by a",
    shows=("Turning. For a free body it is com_offset, unless mass or grasp direction are known; take a second grasp."),
    parameters=parameters,
    variants=(
        (
            "tag_x",
            "tag_y",
            "tag_theta",
        ),
        (
            "tag_x",
            "tag_y",
        ),
    ),
    direction="body",
    exact=True,
)
