# %% [markdown]
# An effect that the library does not have, written as a plain function and found by `diagnose`.
#
# A fan stands in the room and blows across the floor: what comes into its jet is pushed along it. First a recording is
# made in Bullet, with a fan of this script's own that blows on nine parts of a table's side. Then the law is written
# down, with units and priors, and put into the library; from there on it is one hypothesis among the others.
#
# Needs the whole workspace for Bullet: `./pbrl info --help` once, then `. .venv/pbrl.env` and
# `.venv/bin/python examples/your_own_effect.py`. A minute and a half on two cores; `--quick` has less to look for.

# %% What and where
import argparse
import math
from pathlib import Path

import numpy as np

from bullet_sim.client import STEP, BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.hand import HandSpec
from bullet_sim.hand_push import HandRun
from bullet_sim.hand_recording import HandPath, HandPush
from bullet_sim.scene import Scene as BulletScene
from bullet_sim.world import World
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.diagnosis.page import write_diagnosis
from pbrl_bringup.files import write_json
from pbrl_mismatch import EFFECTS, DiagnoseOptions, OwnEffect, Prior, Scene, diagnose, register_effect

parser = argparse.ArgumentParser(description="Have an effect of one's own found.")
parser.add_argument("--out", type=Path, default=Path("out/examples/fan"))
parser.add_argument("--quick", action="store_true", help="24 s of recording, the fan and two others, few draws")
arguments = parser.parse_known_args()[0]

# %% The law, as one would write it on paper: F = f exp(-d^2 / (2 w^2)) along the jet, d across it, on four parts of the
# body. It gives the force and the torque at the origin of the body's frame.
PARTS = ((0.2, 0.3), (0.2, -0.3), (-0.2, 0.3), (-0.2, -0.3))


def blow(time, pose, twist, parameters):
    x, y, theta = pose
    force, place_x, place_y, heading, width = parameters
    ex, ey = math.cos(heading), math.sin(heading)
    c, s = math.cos(theta), math.sin(theta)
    fx = fy = tau = 0.0
    for ax, ay in PARTS:
        rx, ry = c * ax - s * ay, s * ax + c * ay
        across = ex * (y + ry - place_y) - ey * (x + rx - place_x)
        push = 0.25 * force * math.exp(-0.5 * (across / width) ** 2)
        fx += push * ex
        fy += push * ey
        tau += (rx * ey - ry * ex) * push
    return fx, fy, tau


def priors(scene: Scene) -> dict[str, Prior]:
    return {
        "force": Prior(8.0, 0.8, positive=True),
        "x": Prior(float(scene.middle[0]), float(scene.reach[0])),
        "y": Prior(float(scene.middle[1]), float(scene.reach[1])),
        "heading": Prior(0.0, 1.8),
        "width": Prior(0.3, 0.5, positive=True),
    }


register_effect(
    OwnEffect(
        name="fan",
        summary="A fan blows across the floor.",
        law=blow,
        units={"force": "N", "x": "m", "y": "m", "heading": "rad", "width": "m"},
        priors=priors,
        strength=("force",),
        equation="F = f exp(-d^2 / (2 w^2)) along the heading, d across the jet",
        shows="Cross the jet more than once, with the body turned differently.",
        place=("x", "y"),
    )
)


# %% The truth: a fan in Bullet, whose jet is cut off at its edges, on nine parts of the table
class Fan(Effect):
    name = "fan"

    def __init__(self, table, place, heading, force, half):
        super().__init__(table.name)
        self.motion, self.place, self.half, self.force, self.sum = table.motion(), place, half, force, 0.0
        self.along = (math.cos(heading), math.sin(heading))

    def update(self, time):
        self.motion.look()
        self.sum = 0.0
        for local in ((x, y) for x in (-0.25, 0.0, 0.25) for y in (-0.4, 0.0, 0.4)):
            x, y = self.motion.point(local)
            across = self.along[0] * (y - self.place[1]) - self.along[1] * (x - self.place[0])
            share = math.cos(0.5 * math.pi * across / self.half) ** 2 if abs(across) < self.half else 0.0
            push = self.force / 9.0 * share
            self.motion.push((push * self.along[0], push * self.along[1], 0.0), (x, y, self.motion.height))
            self.sum += push

    def strength(self):
        return self.sum


# %% Record: a hand takes the table's edge and moves it to and fro through the jet
time = np.arange(0.0, 24.0 if arguments.quick else 40.0, 0.1)
ramp = np.minimum(1.0, np.minimum(time, time[-1] - time) / 0.6)[:, None]
speeds = np.column_stack([0.14 * np.sin(0.35 * time), 0.05 * np.sin(0.8 * time), 0.2 * np.sin(0.5 * time)])
push = HandPush("table", (-0.4, 0.1), HandPath(time, ramp * speeds, "hand"))
scene = BulletScene.model_validate({
    "name": "fan",
    "room": {"outline": [[-6, -6], [6, -6], [6, 6], [-6, 6]]},
    "bodies": {"table": {"kind": "plain_table", "size": [0.8, 1.2], "nominal_mass": 22.0, "pose": [0.0, 0.0, 0.4]}},
})  # fmt: skip
with BulletClient(step=STEP) as client:
    world = World(client, scene, np.random.default_rng(0))
    world.effects.append(Fan(world.find("table"), place=(0.3, 0.2), heading=2.0, force=9.0, half=0.45))
    run = HandRun(world, push, HandSpec(), "left", np.random.default_rng(1))
    made = run.recording(run.perform([push]))
recording = to_recording(made, scene)
blown = made.activities["fan.table"].strength
print(f"recorded {made.seconds:.0f} s, {made.status}; the fan pushed with up to {blown.max():.1f} N")

# %% Diagnose: the fan's law is weighed against every law of the library
quick = {
    "without": tuple(set(EFFECTS) - {"fan", "external_force", "floor_slope"}),
    "draws": 60,
    "shortlist": 2,
    "survivors": (2,),
}
options = DiagnoseOptions(baseline=("free",), **(quick if arguments.quick else {}))
found = diagnose(recording, options)
one = found.objects["table"]
for note in one.notes:
    print(note)
for hypothesis in one.hypotheses[:5]:
    print(f"  {hypothesis.probability:6.3f}  {' + '.join(hypothesis.effects) or 'nothing'}")
for effect in one.effects:
    for parameter, told in effect.parameters.items():
        print(f"  {parameter:14} {told['mean']:8.3f} ± {told['sd']:.3f} {told['unit']}")

# %% The same report as of `./pbrl diagnose`
arguments.out.mkdir(parents=True, exist_ok=True)
write_json(arguments.out / "report.json", found.to_report())
write_diagnosis(found, recording, "examples/your_own_effect.py", arguments.out / "report.html", options=options)
print(f"{arguments.out / 'report.html'}; held out: {one.report['heldout']['rmse_position_m']}")
