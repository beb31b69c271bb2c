"""A pivot to the world."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, plain, positive

AT_REST = 0.005
"""How far from its rest a bushing is where a recording begins, as a standard deviation [m]."""


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("pivot_stiffness", 4000.0, 1.0),
        plain("pivot_x", float(scene.middle[0]), 0.8 * float(scene.reach[0])),
        plain("pivot_y", float(scene.middle[1]), 0.8 * float(scene.reach[1])),
        positive("pivot_damping", 0.2, 0.7),
        # A tag tells to millimetres where a body stands, each of which is newtons; and it may not have stood at rest.
        plain("pivot_off_x", 0.0, AT_REST),
        plain("pivot_off_y", 0.0, AT_REST),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("world", values["pivot_x"], values["pivot_y"], 0.05)


EFFECT = Effect(
    name="hidden_hinge",
    summary="A point of the body is held to the world, with some give.",
    equation="F = k (h - p) at the body's point p that was over the pivot h when the recording began, or off it by d",
    shows="Push so that it would have to move away: it turns about one point whatever the push.",
    parameters=parameters,
    variants=(
        (
            "pivot_stiffness",
            "pivot_x",
            "pivot_y",
            "pivot_damping",
            "pivot_off_x",
            "pivot_off_y",
        ),
    ),
    where=where,
    place=("pivot_x", "pivot_y"),
    direction="world",
    pins=("pivot_x", "pivot_y"),
)
