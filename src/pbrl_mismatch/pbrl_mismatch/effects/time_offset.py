"""One stream late against another."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (plain("time_offset", 0.0, 0.12),)


EFFECT = Effect(
    name="time_offset",
    summary="The poses come later than the wrenches, or earlier.",
    equation="felt(t) acts at t + T on the poses' clock",
    shows="Fast changes of the force.",
    parameters=parameters,
    variants=(("time_offset",),),
    exact=True,
)
