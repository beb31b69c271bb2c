"""A steady or periodic push from outside."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        plain("force_start", scene.start + 0.2 * scene.seconds, 0.2 * scene.seconds),
        plain("force_end", scene.start + 0.8 * scene.seconds, 0.2 * scene.seconds),
        plain("steady_x", 0.0, scene.force),
        plain("steady_y", 0.0, scene.force),
        plain("steady_torque", 0.0, 0.4 * scene.force * scene.size),
        plain("periodic_x", 0.0, scene.force),
        plain("periodic_y", 0.0, scene.force),
        plain("periodic_torque", 0.0, 0.2 * scene.force * scene.size),
        positive("periodic_frequency", 0.5, 0.7),
        plain("periodic_phase", 0.0, 1.8),
    )


EFFECT = Effect(
    name="external_force",
    summary="Something outside pushes, steadily or in a rhythm.",
    equation="F = F_0 or F_1 sin(2 pi f t + phi), likewise the moment, all the time or between two moments",
    shows=("Irregular pushing, so that a rhythm of one's own is not taken for it; for a steady one, turn the body."),
    parameters=parameters,
    variants=(
        (
            "steady_x",
            "steady_y",
            "steady_torque",
        ),
        (
            "steady_x",
            "steady_y",
            "steady_torque",
            "force_start",
            "force_end",
        ),
        (
            "periodic_x",
            "periodic_y",
            "periodic_torque",
            "periodic_frequency",
            "periodic_phase",
        ),
        (
            "periodic_x",
            "periodic_y",
            "periodic_torque",
            "periodic_frequency",
            "periodic_phase",
            "force_start",
            "force_end",
        ),
    ),
    direction="world",
    angles=("periodic_phase",),
    moments=("force_start", "force_end"),
    rhythm=("periodic_frequency", "periodic_phase"),
    linear=("steady_x", "steady_y", "steady_torque", "periodic_x", "periodic_y", "periodic_torque"),
    exact=True,
)
