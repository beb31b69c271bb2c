"""The mass changes at some moment."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, on_body, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("payload_mass", 0.3 * scene.mass, 0.7),
        plain("payload_time", scene.start + 0.5 * scene.seconds, 0.35 * scene.seconds),
        on_body("payload_x", float(scene.centroid[0]), float(scene.half[0]), 0.5),
        on_body("payload_y", float(scene.centroid[1]), float(scene.half[1]), 0.5),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("body", values["payload_x"], values["payload_y"], 0.1)


EFFECT = Effect(
    name="payload_change",
    summary="Something is put on or taken off at some moment.",
    equation="m -> m + M or m + M -> m at t_p; M sits at a point, so centre of mass and inertia move too",
    shows="Push with the same force before and after.",
    parameters=parameters,
    variants=(
        (
            "payload_mass",
            "payload_time",
            "payload_x",
            "payload_y",
        ),
        (
            "payload_mass",
            "payload_time",
            "payload_x",
            "payload_y",
        ),
    ),
    fixed_in={1: {"payload_gone": 1.0}},
    where=where,
    place=("payload_x", "payload_y"),
    direction="acceleration",
    moments=("payload_time",),
    lasts=("payload_time", "payload_gone"),
    linear=("payload_mass",),
    exact=True,
)
