"""Another wheel or locked caster."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, on_body, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        on_body("wheel2_x", float(scene.centroid[0]), float(scene.half[0]), 0.8),
        on_body("wheel2_y", float(scene.centroid[1]), float(scene.half[1]), 0.8),
        plain("wheel2_theta", 0.0, 1.0),
        positive("wheel2_mu_x", 0.08, 1.0),
        positive("wheel2_mu_y", 0.08, 1.0),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("body", values["wheel2_x"], values["wheel2_y"], 0.05)


EFFECT = Effect(
    name="second_wheel",
    summary="A second wheel, or a locked caster, drags elsewhere on the body.",
    equation="dry friction at a point of the body along two axes of its own, at most mu_x m g and mu_y m g",
    shows=(
        "Much turning against little travel: the force's moment then tells where it stands. Confused with "
        "viscous drag where it creeps."
    ),
    parameters=parameters,
    variants=(
        ("wheel2_x", "wheel2_y", "wheel2_mu_x"),
        ("wheel2_x", "wheel2_y", "wheel2_theta", "wheel2_mu_x", "wheel2_mu_y"),
    ),
    fixed={"wheel2_mu_y": -1.0},
    where=where,
    place=("wheel2_x", "wheel2_y"),
    direction="body",
    angles=("wheel2_theta",),
    linear=("wheel2_mu_x", "wheel2_mu_y"),
    second=True,
    sticks=True,
)
