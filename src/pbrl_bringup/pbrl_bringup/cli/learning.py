"""The commands that learn from recordings, one or many."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbrl_bringup.cli.handing import hand_over
from pbrl_bringup.cli.options import Bags, Draws, Engine, Likelihood, Listed, Mapping, Out, Sampler, Scheduler, Seed


def fit(
    bags: Bags = None,
    mapping: Mapping = None,
    out: Out = Path("out/fit"),
    model_class: Annotated[
        str,
        typer.Option(
            help="free, wheel, wheel+ground or hinge; auto: hinge where only a point of the body was seen, "
            "else wheel+ground (a wheel, and friction of the whole body on the floor)."
        ),
    ] = "auto",
    likelihood: Annotated[Likelihood, typer.Option(help="How motion is compared.")] = Likelihood.WINDOWED,
    sampler: Annotated[
        Sampler,
        typer.Option(help="importance: every mode, with an evidence; metropolis: block-wise chains, the thesis's way."),
    ] = Sampler.IMPORTANCE,
    engine: Annotated[
        Engine, typer.Option(help="What simulates: the compiled kernel, or pymunk, the thesis's way and far slower.")
    ] = Engine.KERNEL,
    draws: Draws = None,
    priors: Annotated[
        Path | None, typer.Option(help="YAML file of priors, as config/params/priors.yaml. Default: what stands there.")
    ] = None,
    seed: Seed = 0,
    listed: Listed = None,
    scheduler: Scheduler = None,
) -> int:
    """Learn the physics of every object that was pushed in a recording; of many, a folder each and a summary."""
    return hand_over(
        "fit",
        bags=bags or [],
        listed=listed,
        mapping=mapping,
        out=out,
        model_class=model_class,
        likelihood=str(likelihood),
        sampler=str(sampler),
        engine=str(engine),
        draws=draws,
        priors=priors,
        seed=seed,
        scheduler=scheduler,
    )


def diagnose(
    bags: Bags = None,
    mapping: Mapping = None,
    out: Out = Path("out/diagnose"),
    baseline: Annotated[
        list[str] | None,
        typer.Option(
            help="What is no mismatch: free, caster (one that is locked), wheel, ground, wheel+ground or hinge; or a "
            "model's file of fit or diagnose, which its object then has alone. As often as needed, the best kind "
            "counts. Default: free, caster and wheel."
        ),
    ] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="An effect that the library does without, as often as needed.")
    ] = None,
    effects: Annotated[
        list[Path] | None,
        typer.Option(help="Python file that adds effects of one's own (docs/mismatch.md), as often as needed."),
    ] = None,
    mass_spread: Annotated[
        float | None,
        typer.Option(help="How well the mass that was told is known: 0.2 is to 20 %. Default: 0.1."),
    ] = None,
    grasp_spread: Annotated[
        float | None,
        typer.Option(help="How well the gripper's direction is known [rad]. Default: 0, exactly."),
    ] = None,
    outline_spread: Annotated[
        float | None,
        typer.Option(help="How well each side of the outline is known [m]. Default: 0, exactly."),
    ] = None,
    most_together: Annotated[
        int | None,
        typer.Option(min=1, max=3, help="Effects at most that are sought together; more take longer. Default: 2."),
    ] = None,
    seed: Seed = 0,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=256,
            help="Threads of a diagnosis; the result does not depend on them. Default: 2, of many recordings 1.",
        ),
    ] = None,
    listed: Listed = None,
    scheduler: Scheduler = None,
) -> int:
    """Say where recording and model part, what physics was left out, and show that the repair predicts better."""
    return hand_over(
        "diagnose",
        bags=bags or [],
        listed=listed,
        mapping=mapping,
        out=out,
        baseline=baseline or [],
        without=without or [],
        effects=effects or [],
        settings={
            "mass_spread": mass_spread,
            "grasp_spread": grasp_spread,
            "outline_spread": outline_spread,
            "most_together": most_together,
        },
        seed=seed,
        workers=workers,
        scheduler=scheduler,
    )
