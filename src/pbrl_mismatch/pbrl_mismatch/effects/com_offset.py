"""Centre of mass off the centroid."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        plain("com_x", 0.0, 0.25 * float(scene.half[0])),
        plain("com_y", 0.0, 0.25 * float(scene.half[1])),
        positive("inertia_factor", 1.0, 0.25),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("body", float(scene.com[0]) + values["com_x"], float(scene.com[1]) + values["com_y"], 0.05)


EFFECT = Effect(
    name="com_offset",
    summary="The centre of mass is not at the centroid, and the inertia with it.",
    equation="com = centroid + d; moment of inertia about it free",
    shows=(
        "Fast reversals and turns. For a free body it is a tag glued on with an offset, unless mass or grasp "
        "are known well."
    ),
    parameters=parameters,
    variants=(
        (
            "com_x",
            "com_y",
            "inertia_factor",
        ),
    ),
    where=where,
    place=("com_x", "com_y"),
    direction="body",
    exact=True,
)
