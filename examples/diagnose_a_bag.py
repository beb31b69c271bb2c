# %% [markdown]
# Where a recording and a model part, what was left out, and whether the repaired model predicts better, with
# `pbrl_bag`, `pbrl_model` and `pbrl_mismatch` alone: no ROS is needed.
#
# A recording to try it on: `./pbrl simulate tethered_table --push turn_table --out out/tethered`.
# Run it cell by cell, or whole: `python examples/diagnose_a_bag.py out/tethered`. About a minute on two cores for a
# minute of pushing, and some more the first time, for compiling; `--quick` looks for four effects only.

# %% What to read, and where results go
import argparse
import json
from pathlib import Path

import numpy as np

from pbrl_bag import BagError, read_recording
from pbrl_mismatch import EFFECTS, DiagnoseOptions, MismatchError, diagnose
from pbrl_mismatch.repaired import rows_of, saved_model
from pbrl_model import ModelError
from pbrl_model.model_file import save_model

parser = argparse.ArgumentParser(description="Diagnose a recording.")
parser.add_argument("bag", nargs="?", type=Path, default=Path("out/tethered"))
parser.add_argument("--map", type=Path, help="mapping file of a foreign recording")
parser.add_argument("--out", type=Path, default=Path("out/examples/diagnose"))
parser.add_argument("--quick", action="store_true", help="four effects, few draws")
arguments = parser.parse_known_args()[0]

# %% Read
try:
    recording = read_recording(arguments.bag, arguments.map)
except BagError as error:
    make = "./pbrl simulate tethered_table --push turn_table --out out/tethered"
    raise SystemExit(f"{error}\nmake one: {make}") from None

# %% Diagnose. What is no mismatch is the baseline: here a table that may have a wheel and friction on the floor.
quick = {
    "without": tuple(set(EFFECTS) - {"tether", "floor_slope", "viscous_drag", "external_force"}),
    "draws": 60,
    "shortlist": 3,
    "survivors": (2,),
}
try:
    found = diagnose(recording, DiagnoseOptions(baseline=("wheel+ground",), **(quick if arguments.quick else {})))
except (MismatchError, ModelError) as error:
    raise SystemExit(str(error)) from None

# %% What was found, and how sure that is
for one in found.objects.values():
    for note in one.notes:
        print(note)
    for hypothesis in one.hypotheses[:5]:
        print(f"  {hypothesis.probability:6.3f}  {' + '.join(hypothesis.effects) or 'nothing'}")
    for effect in one.effects:
        for parameter, told in effect.parameters.items():
            print(f"  {parameter:18} {told['mean']:8.3f} ± {told['sd']:.3f} {told['unit']}")

# %% The wrench that the model lacks, over time: for a plot of one's own
for name, one in found.objects.items():
    size = np.hypot(*one.residual.world[:, :2].T)
    print(f"{name}: {np.quantile(size, 0.95):.1f} N are left out in the strongest twentieth of the time")

# %% Keep the report and the repaired model; the simulator and the planner load it
arguments.out.mkdir(parents=True, exist_ok=True)
(arguments.out / "report.json").write_text(json.dumps(found.to_report(), indent=1), encoding="utf-8")
for name, one in found.objects.items():
    model = saved_model(np.random.default_rng(0), one.repaired, one.baseline.peak.objective.cuts.track, one.notes[1:])
    save_model(model, arguments.out / f"model_{name}.json")
    print(f"{name}: {rows_of(model, draws=True).shape[0]} draws of the repaired model in {arguments.out}")
