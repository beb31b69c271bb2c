"""`./pbrl fit BAG...`: learn from recordings; report.json, report.html and the posteriors of each."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
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
from pbrl_bringup.scale.address import LOCAL
from pbrl_bringup.scale.command_line import command_of
from pbrl_bringup.scale.recordings import choose_recordings
from pbrl_bringup.terminal import output, say, styled, table
from pbrl_model.arviz_bridge import save_posterior
from pbrl_model.fitted_model import fitted_model
from pbrl_model.fitting.fit import Fit, FitOptions, fit_recording
from pbrl_model.model_file import save_model
from pbrl_model.prior_options import load_prior_options

AUTO = "auto"
"""The class of a model that depends on what a recording shows."""
SHOWN = {
    "object": "object",
    "model_class": "class",
    "mass_mean": "mass, kg",
    "heldout_before_m": "held out before, m",
    "heldout_after_m": "after, m",
}
"""Columns of a summary of many that the terminal shows."""


@dataclass(frozen=True)
class Asked:
    """What is learned, of every recording alike.

    Attributes:
        mapping: of topics; None: ours.
        model_class: "auto", or one for all.
        options: settings, but for the class of "auto".
        typed: options on the command line, by name.
    """

    mapping: Path | None
    model_class: str
    options: FitOptions
    typed: Mapping[str, Any]


def command(
    bags: Sequence[Path],
    listed: Path | None,
    mapping: Path | None,
    out: Path,
    model_class: str,
    likelihood: str,
    sampler: str,
    engine: str,
    draws: int | None,
    priors: Path | None,
    seed: int,
    scheduler: str | None,
) -> int:
    """Learn every object of a recording, or of many.

    Raises:
        BagError: the recording cannot be read or is malformed.
        ModelError: it cannot be learned from, or the priors cannot be used.
        BringupError: the results cannot be written, there is no such scheduler, or some of many recordings failed.
    """
    chosen = choose_recordings(bags, listed)
    told: dict[str, Any] = {} if draws is None else {"draws": draws}
    if priors is not None:
        told["priors"] = load_prior_options(priors)
    if model_class != AUTO:
        told["model_class"] = model_class
    options = FitOptions(likelihood=likelihood, sampler=sampler, engine=engine, seed=seed, **told)
    if chosen.several or scheduler is not None:
        mapping, priors = (None if each is None else each.absolute() for each in (mapping, priors))
        typed: dict[str, Any] = {
            "map": mapping,
            "model_class": model_class,
            "likelihood": likelihood,
            "sampler": sampler,
        }
        typed |= {"engine": engine, "draws": draws, "priors": priors, "seed": seed}
        asked = Asked(mapping, model_class, options, typed)
        many = import_module("pbrl_bringup.scale.many")  # Dask is slow to load
        return int(many.run_many(learn_one, chosen.bags, asked, out, scheduler or LOCAL, SHOWN, "learning"))
    recording = read_recording(chosen.bags[0], mapping)
    for note in recording.notes:
        say(f"pbrl: {note}")
    options = for_class(recording, model_class, options)
    with result_folder(out) as folder:
        how = f"{options.model_class}, {likelihood}, {sampler}, {engine}, seed {seed}"
        with Console(stderr=True).status(f"learning ({how})"):
            fit = fit_recording(recording, options)
        report = write_fit(recording, fit, folder, seed, "./pbrl " + shlex.join(sys.argv[1:]))
    print_fit(fit, report)
    output().print(styled(str(out / "report.html"), "bold"))
    return 0


def learn_one(bag: Path, folder: Path, asked: Asked) -> list[dict[str, Any]]:
    """Learn one of many recordings, write what `fit` writes, and return a row for each object.

    Args:
        bag: recording.
        folder: for its results; it exists.
        asked: what is learned.

    Raises:
        BagError, ModelError, BringupError: as `command`.
    """
    recording = read_recording(bag, asked.mapping)
    options = for_class(recording, asked.model_class, asked.options)
    fit = fit_recording(recording, options)
    write_fit(recording, fit, folder, options.seed, command_of("fit", bag, folder, **asked.typed))
    rows = []
    for name, found in fit.objects.items():
        row: dict[str, Any] = {"object": name, "model_class": options.model_class}
        for parameter, each in found.posterior.summary().items():
            row |= {f"{parameter}_mean": each["mean"], f"{parameter}_sd": each["sd"]}
        heldout = found.heldout
        row["heldout_before_m"] = None if heldout is None else heldout.before.final_position
        row["heldout_after_m"] = None if heldout is None else heldout.after.final_position
        rows.append(row)
    return rows


def for_class(recording: Recording, model_class: str, options: FitOptions) -> FitOptions:
    """Return the settings with the class that was asked for, or that suits the recording."""
    return options.model_copy(update={"model_class": class_for(recording)}) if model_class == AUTO else options


def write_fit(recording: Recording, fit: Fit, folder: Path, seed: int, command_line: str) -> Report:
    """Write posteriors, models, `report.json` and `report.html`; return what the page shows."""
    report = fit_report(recording, fit, seed, command_line)
    for name, found in fit.objects.items():
        save_posterior(found.posterior, folder / f"posterior_{name}.nc")
        kept = fitted_model(np.random.default_rng(seed), found, recording.bodies[name])
        save_model(kept, folder / f"model_{name}.json")
    write_json(folder / "report.json", fit.to_report())
    write_page(report, folder / "report.html")
    return report


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
