"""The floor tilts."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        plain("slope_x", 0.0, 0.03),
        plain("slope_y", 0.0, 0.03),
    )


EFFECT = Effect(
    name="floor_slope",
    summary="The floor tilts, so that a share of the weight pulls one way.",
    equation="F = m g (s_x, s_y), at the centre of mass",
    shows=(
        "A force that is constant in the world and follows the mass. A steady external force at the centre of"
        " mass is the same unless the mass changes."
    ),
    parameters=parameters,
    variants=(
        (
            "slope_x",
            "slope_y",
        ),
    ),
    direction="world",
    linear=("slope_x", "slope_y"),
    exact=True,
)
