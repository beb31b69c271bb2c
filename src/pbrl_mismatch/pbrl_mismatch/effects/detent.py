"""A catch at one configuration."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, on_body, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("detent_force", 0.7 * scene.force, 1.0),
        plain("detent_x", float(scene.middle[0]), 0.7 * float(scene.reach[0])),
        plain("detent_y", float(scene.middle[1]), 0.7 * float(scene.reach[1])),
        positive("detent_width", 0.03, 0.7),
        on_body("detent_at_x", float(scene.centroid[0]), float(scene.half[0]), 0.6),
        on_body("detent_at_y", float(scene.centroid[1]), float(scene.half[1]), 0.6),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("world", values["detent_x"], values["detent_y"], values["detent_width"])


EFFECT = Effect(
    name="detent",
    summary="A catch (magnet, latch, door seal) holds the body near one place.",
    equation="F = -F_0 (d / w) exp(1/2 - d^2 / 2 w^2) from a point of the body to the place, its peak F_0 at d = w",
    shows="Go slowly through the place, in both directions.",
    parameters=parameters,
    variants=(
        (
            "detent_force",
            "detent_x",
            "detent_y",
            "detent_width",
        ),
        (
            "detent_force",
            "detent_x",
            "detent_y",
            "detent_width",
            "detent_at_x",
            "detent_at_y",
        ),
    ),
    where=where,
    place=("detent_x", "detent_y"),
    direction="place",
    linear=("detent_force",),
    pulls=("detent_x", "detent_y", "detent_at_x", "detent_at_y"),
)
