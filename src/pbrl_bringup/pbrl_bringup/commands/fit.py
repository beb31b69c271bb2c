"""`./pbrl fit BAG`: learn from a recording; report.json, report.html and the posteriors."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from pbrl_bag import Recording, read_recording
from pbrl_bringup.files import result_folder, write_json
from pbrl_bringup.replay import replay
from pbrl_bringup.report_build import object_report, whole_report
from pbrl_bringup.report_data import Report
from pbrl_bringup.report_page import number, rounded, write_page
from pbrl_bringup.terminal import output, say, styled, table
from pbrl_model.arviz_bridge import save_posterior
from pbrl_model.fitted_model import fitted_model
from pbrl_model.fitting.fit import Fit, FitOptions, fit_recording
from pbrl_model.model_file import save_model
from pbrl_model.prior_options import load_prior_options


def command(
    bag: Path,
    mapping: Path | None,
    out: Path,
    model_class: str,
    likelihood: str,
    sampler: str,
    engine: str,
    draws: int | None,
    priors: Path | None,
    seed: int,
) -> int:
    """Learn every object of a recording.

    Raises:
        BagError: the recording cannot be read or is malformed.
        ModelError: it cannot be learned from, or the priors cannot be used.
        BringupError: the results cannot be written.
    """
    recording = read_recording(bag, mapping)
    for note in recording.notes:
        say(f"pbrl: {note}")
    chosen = class_for(recording) if model_class == "auto" else model_class
    asked: dict[str, Any] = {} if draws is None else {"draws": draws}
    if priors is not None:
        asked["priors"] = load_prior_options(priors)
    options = FitOptions(model_class=chosen, likelihood=likelihood, sampler=sampler, engine=engine, seed=seed, **asked)
    with result_folder(out) as folder:
        with Console(stderr=True).status(f"learning ({chosen}, {likelihood}, {sampler}, {engine}, seed {seed})"):
            fit = fit_recording(recording, options)
        report = fit_report(recording, fit, seed, "./pbrl " + shlex.join(sys.argv[1:]))
        for name, found in fit.objects.items():
            save_posterior(found.posterior, folder / f"posterior_{name}.nc")
            kept = fitted_model(np.random.default_rng(seed), found, recording.bodies[name])
            save_model(kept, folder / f"model_{name}.json")
        write_json(folder / "report.json", fit.to_report())
        write_page(report, folder / "report.html")
    print_fit(fit, report)
    output().print(styled(str(out / "report.html"), "bold"))
    return 0


def class_for(recording: Recording) -> str:
    """Return what to learn where nobody says: of a body seen as a point no wheel can be placed, only a hinge."""
    held = {grasp.object for grasp in recording.grasps}
    streams = [stream for name, stream in recording.object_poses.items() if name in held]
    oriented = any(np.isfinite(stream.quaternion).any() for stream in streams)
    return FitOptions().model_class if oriented or not streams else "hinge"


def fit_report(recording: Recording, fit: Fit, seed: int, command_line: str) -> Report:
    """Return what the page of a fit shows."""
    rng = np.random.default_rng(seed)
    objects = []
    for name, found in fit.objects.items():
        replays = replay(recording, found.motions, found.posterior, found.body, rng)
        objects.append(object_report(recording.bodies[name], found.posterior, replays, found.heldout, rng))
    return whole_report("What was learned from one recording", recording, objects, command_line, seed, fit.seconds)


def print_fit(fit: Fit, report: Report) -> None:
    """Print the parameters of every object, and what the data do not say."""
    for name, found in fit.objects.items():
        rows = [
            (
                parameter.name,
                rounded(parameter.mean, parameter.sd),
                number(parameter.sd),
                parameter.unit,
                parameter.prior,
            )
            for part in report.objects
            if part.name == name
            for parameter in part.parameters
        ]
        title = f"{name} ({found.posterior.model_class}), {len(found.posterior.flat)} draws, {fit.seconds:.1f} s"
        output().print(table(title, ("parameter", "mean", "sd", "unit", "prior, 90 %"), rows, right=(1, 2)))
        if found.heldout:
            before, after = found.heldout.before.final_position, found.heldout.after.final_position
            output().print(
                f"held out: {found.heldout.count} window(s) of {found.heldout.seconds:.1f} s, "
                f"end off by {100 * before:.1f} cm before learning, {100 * after:.1f} cm after"
            )
        for note in found.notes:
            output().print(f"note: {note}")
        output().print()
    output().print(report.verdict)
