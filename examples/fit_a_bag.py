# %% [markdown]
# Learn the physics of what was pushed in a recording, with `pbrl_bag` and `pbrl_model` alone: no ROS is needed.
#
# A recording to try it on: `./pbrl simulate locked_caster --push turn_table --out out/push`.
# Run it cell by cell (VS Code, Jupytext), or whole: `python examples/fit_a_bag.py out/push`. About half a minute on one
# core, and a minute or two more the first time, for compiling.

# %% What to read, and where results go
import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pbrl_bag import BagError, read_recording
from pbrl_model import FitOptions, ModelError, fit_recording, predict
from pbrl_model.arviz_bridge import save_posterior

parser = argparse.ArgumentParser(description="Learn from a recording.")
parser.add_argument("bag", nargs="?", type=Path, default=Path("out/push"))
parser.add_argument("--map", type=Path, help="mapping file of a foreign recording")
parser.add_argument("--out", type=Path, default=Path("out/examples/fit"))
parser.add_argument("--draws", type=int, default=500, help="of each of four parts of the posterior")
arguments = parser.parse_known_args()[0]

# %% Read: what was felt at the wrists, what tags saw, who held what, and the outlines
try:
    recording = read_recording(arguments.bag, arguments.map)
except BagError as error:
    raise SystemExit(f"{error}\nmake one: ./pbrl simulate locked_caster --push turn_table --out out/push") from None
for grasp in recording.grasps:
    print(f"{grasp.gripper} holds {grasp.object} from {grasp.start:.1f} to {grasp.end:.1f} s")

# %% Learn: a body with a wheel anywhere (a caster that is locked, say) and friction of the whole body on the floor
try:
    fit = fit_recording(recording, FitOptions(model_class="wheel+ground", draws=arguments.draws, seed=0))
except ModelError as error:
    raise SystemExit(str(error)) from None
for name, found in fit.objects.items():
    print(f"\n{name}, in {fit.seconds:.1f} s, log evidence {found.posterior.log_evidence:.1f}")
    for parameter, told in found.posterior.summary().items():
        print(f"  {parameter:12} {told['mean']:8.3f} ± {told['sd']:.3f} {told['unit']}")
    for note in found.notes:
        print(f"  note: {note}")

# %% Keep the posterior, for ArviZ and for every tool that reads netCDF
arguments.out.mkdir(parents=True, exist_ok=True)
for name, found in fit.objects.items():
    save_posterior(found.posterior, arguments.out / f"posterior_{name}.nc")

# %% Look: where the wheel is on the body, and the first push predicted from its forces alone
for name, found in fit.objects.items():
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.5))
    outline = recording.bodies[name].footprint
    left.plot(*np.vstack([outline, outline[:1]]).T, "k-")
    left.plot(found.posterior.column("wheel_x").ravel(), found.posterior.column("wheel_y").ravel(), ".", alpha=0.3)
    left.set(title=f"{name}: the wheel", xlabel="x [m], body's frame", ylabel="y [m]", aspect="equal")
    motion = found.motions[0]
    poses = predict(motion, found.posterior.rows()[::20], found.body).poses
    right.plot(*np.moveaxis(poses[..., :2], -1, 0).reshape(2, len(poses), -1).transpose(0, 2, 1), "C0-", alpha=0.1)
    right.plot(*recording.object_poses[name].position[:, :2].T, "k.", markersize=2)
    right.set(title="predicted (blue), recorded (black)", xlabel="x [m], world", ylabel="y [m]", aspect="equal")
    figure.savefig(arguments.out / f"{name}.png", dpi=110)
    plt.close(figure)
print(f"\n{arguments.out}: {', '.join(sorted(path.name for path in arguments.out.iterdir()))}")
