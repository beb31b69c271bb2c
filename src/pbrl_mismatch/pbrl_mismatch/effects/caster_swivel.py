"""Trailing casters that have to turn first."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain, positive

HEADINGS = ("caster_heading", "caster_turn2", "caster_turn3", "caster_turn4")
"""How casters were turned when the recording began: the first in the body, the others from there."""


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("caster_trail", 0.03, 0.4),
        positive("caster_roll", 0.02, 0.9),
        positive("caster_scrub", 0.03, 0.9),
        positive("caster_twist", 0.04, 0.9),
        positive("caster_lay", 0.02, 1.0),
        *(plain(column, 0.0, 1.5) for column in HEADINGS),
    )


EFFECT = Effect(
    name="caster_swivel",
    summary=(
        "Trailing casters: wheels roll along each caster's heading, which follows the motion with a lag; bearings and "
        "treads resist its turn."
    ),
    equation=(
        "heading' = (e x v) / trail; F_i = -(m g / n) (mu_r sign(v . e) e + mu_t min(1, lay heading' / |v . e|) e_perp "
        "+ mu_s sign(heading' - omega) e_perp at the wheel)"
    ),
    shows="Reversals: only then does the heading lag. Without them it is ground friction.",
    parameters=parameters,
    variants=(
        (
            "caster_trail",
            "caster_roll",
            "caster_scrub",
            "caster_twist",
            *HEADINGS,
        ),
        (
            "caster_trail",
            "caster_roll",
            "caster_scrub",
            "caster_twist",
            "caster_lay",
            *HEADINGS,
        ),
    ),
    direction="velocity",
    angles=HEADINGS,
    linear=("caster_roll", "caster_scrub", "caster_twist"),
    remembers=True,
    sticks=True,
)
