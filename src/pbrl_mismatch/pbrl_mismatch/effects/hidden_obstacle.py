"""A fixed thing nobody told us of."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, plain, positive, rectangle
from pbrl_mismatch.kernels.crate_kernel import ROUND


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("obstacle_stiffness", 15000.0, 0.8),
        plain("obstacle_x", float(scene.middle[0]), float(scene.reach[0])),
        plain("obstacle_y", float(scene.middle[1]), float(scene.reach[1])),
        positive("obstacle_radius", 0.1, 0.6),
        positive("obstacle_friction", 0.3, 0.6),
        plain("obstacle_angle", 0.0, 0.5),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    x, y, half = values["obstacle_x"], values["obstacle_y"], values["obstacle_radius"]
    if "obstacle_angle" in values:
        return rectangle("world", x, y, half, half, values["obstacle_angle"])
    return disc("world", x, y, half)


EFFECT = Effect(
    name="hidden_obstacle",
    summary="A fixed thing that is not in the scene stops the body where they touch.",
    equation="F = -k depth n of a disc in the footprint, with friction, or at each corner of a square, without",
    shows="Go back to the place: what is fixed stops you there again, what is movable is gone.",
    parameters=parameters,
    variants=(
        (
            "obstacle_stiffness",
            "obstacle_x",
            "obstacle_y",
            "obstacle_radius",
            "obstacle_friction",
        ),
        (
            "obstacle_stiffness",
            "obstacle_x",
            "obstacle_y",
            "obstacle_radius",
            "obstacle_friction",
            "obstacle_angle",
        ),
    ),
    fixed={"obstacle_angle": ROUND},
    where=where,
    place=("obstacle_x", "obstacle_y"),
    direction="contact",
    angles=("obstacle_angle",),
    touches=("obstacle_x", "obstacle_y", "obstacle_radius"),
)
