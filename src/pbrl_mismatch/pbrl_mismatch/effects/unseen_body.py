"""A movable thing nobody told us of."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, plain, positive, rectangle
from pbrl_mismatch.kernels.crate_kernel import ROUND


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("unseen_force", 0.5 * scene.force, 1.2),
        plain("unseen_x", float(scene.middle[0]), float(scene.reach[0])),
        plain("unseen_y", float(scene.middle[1]), float(scene.reach[1])),
        positive("unseen_radius", 0.15, 0.5),
        plain("unseen_angle", 0.0, 0.5),
        positive("unseen_friction", 0.2, 0.7),
        positive("unseen_tip", 0.6, 0.5),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    x, y, half = values["unseen_x"], values["unseen_y"], values["unseen_radius"]
    if "unseen_angle" in values:
        return rectangle("world", x, y, half, half, values["unseen_angle"])
    return disc("world", x, y, half)


EFFECT = Effect(
    name="unseen_body",
    summary="A movable thing that is not in the scene is met on the way and pushed along.",
    equation="contact with a disc or a square of mass F / (mu g) that slides, and turns, against friction F",
    shows="Go back to where it was met: it is gone.",
    parameters=parameters,
    variants=(
        (
            "unseen_force",
            "unseen_x",
            "unseen_y",
            "unseen_radius",
            "unseen_friction",
        ),
        (
            "unseen_force",
            "unseen_x",
            "unseen_y",
            "unseen_radius",
            "unseen_angle",
            "unseen_friction",
            "unseen_tip",
        ),
    ),
    fixed={"unseen_angle": ROUND},
    where=where,
    place=("unseen_x", "unseen_y"),
    direction="contact",
    angles=("unseen_angle",),
    linear=("unseen_force",),
    remembers=True,
    touches=("unseen_x", "unseen_y", "unseen_radius"),
)
