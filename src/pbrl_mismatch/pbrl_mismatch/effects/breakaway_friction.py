"""Static friction above sliding friction."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("slide_mu", 0.05, 1.2),
        positive("slide_extent", 1.0, 0.25),
        plain("load_x", 0.0, 0.3 * float(scene.half[0])),
        plain("load_y", 0.0, 0.3 * float(scene.half[1])),
        positive("load_height", 0.5, 0.7),
        positive("breakaway_mu", 0.05, 1.0),
        positive("breakaway_speed", 0.02, 0.7),
    )


EFFECT = Effect(
    name="breakaway_friction",
    summary="Friction is higher at rest than in motion (Stribeck), at every foot.",
    equation="mu(v) = mu_k + mu_s exp(-(v / v_s)^2), F as in ground_friction",
    shows=("Jerks at the start of each motion. Needs slow starts and stops; above a few cm/s it is ground friction."),
    parameters=parameters,
    variants=(
        (
            "slide_mu",
            "slide_extent",
            "load_x",
            "load_y",
            "load_height",
            "breakaway_mu",
            "breakaway_speed",
        ),
    ),
    direction="velocity",
    linear=("slide_mu", "breakaway_mu"),
    sticks=True,
    limit="ground_friction",
)
