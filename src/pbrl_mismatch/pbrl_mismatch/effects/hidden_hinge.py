"""A pivot to the world."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("pivot_stiffness", 4000.0, 1.0),
        plain("pivot_x", float(scene.middle[0]), 0.8 * float(scene.reach[0])),
        plain("pivot_y", float(scene.middle[1]), 0.8 * float(scene.reach[1])),
        positive("pivot_damping", 0.2, 0.7),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("floor", values["pivot_x"], values["pivot_y"], 0.05)


EFFECT = Effect(
    name="hidden_hinge",
    summary="A point of the body is held to the world, with some give.",
    equation="F = k (h - p) at the body's point that was over the pivot h when the episode began",
    shows="Push so that it would have to move away: it turns about one point whatever the push.",
    parameters=parameters,
    variants=(
        (
            "pivot_stiffness",
            "pivot_x",
            "pivot_y",
            "pivot_damping",
        ),
    ),
    where=where,
    place=("pivot_x", "pivot_y"),
    direction="world",
    pins=("pivot_x", "pivot_y"),
)
