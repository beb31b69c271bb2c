"""Sliding friction over the whole footprint."""

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
    )


EFFECT = Effect(
    name="ground_friction",
    summary=("The body slides on its feet: dry friction at each of them, so that force and moment are coupled."),
    equation=(
        "F = -sum_i mu N_i v_i / |v_i| at the n points that carry the load, tau from their levers; the N_i, m g / n on "
        "average, tilt to a centre of load that a force F at the height h moves on by h F / (m g)"
    ),
    shows=(
        "A force against the velocity whose size does not follow the speed; a moment while it turns. "
        "Breakaway friction and trailing casters look alike unless it starts slowly or reverses."
    ),
    parameters=parameters,
    variants=(
        (
            "slide_mu",
            "slide_extent",
            "load_x",
            "load_y",
            "load_height",
        ),
    ),
    direction="velocity",
    linear=("slide_mu",),
    sticks=True,
)
