"""A load that swings or slides inside."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("slosh_mass", 0.15 * scene.mass, 0.8),
        plain("slosh_x", float(scene.centroid[0]), 0.3 * float(scene.half[0])),
        plain("slosh_y", float(scene.centroid[1]), 0.3 * float(scene.half[1])),
        positive("slosh_frequency", 0.8, 0.5),
        positive("slosh_damping", 0.1, 0.8),
    )


EFFECT = Effect(
    name="sloshing_load",
    summary="A load inside swings: it lags behind and comes back.",
    equation="M (q'' + a) = -M w^2 q - 2 M z w q', and its opposite on the body",
    shows="Irregular pushing with reversals; a periodic push looks like a periodic external force.",
    parameters=parameters,
    variants=(
        (
            "slosh_mass",
            "slosh_frequency",
            "slosh_damping",
            "slosh_x",
            "slosh_y",
        ),
    ),
    direction="acceleration",
    linear=("slosh_mass",),
    remembers=True,
)
