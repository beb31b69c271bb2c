"""Trailing casters that have to turn first."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("caster_trail", 0.03, 0.4),
        positive("caster_roll", 0.02, 0.9),
        positive("caster_scrub", 0.02, 0.9),
        plain("caster_heading", 0.0, 1.5),
    )


EFFECT = Effect(
    name="caster_swivel",
    summary=(
        "Trailing casters: the resistance points along each caster's heading, which follows the motion with a lag."
    ),
    equation=(
        "heading' = (v x heading) / trail; F_i = -(m g / n) (mu_r sign(v_i . e) e + mu_s sign(v_i . e_perp) e_perp)"
    ),
    shows="Reversals: only then does the heading lag. Without them it is ground friction.",
    parameters=parameters,
    variants=(
        (
            "caster_trail",
            "caster_roll",
            "caster_scrub",
            "caster_heading",
        ),
    ),
    direction="velocity",
    angles=("caster_heading",),
    linear=("caster_roll", "caster_scrub"),
    remembers=True,
    sticks=True,
)
