"""How many pushes until it is known what was left out: chosen by expected information, or at random.

One effect of a group is true in Bullet, which of them is concealed. A first push, short, slow and straight, leaves
several possible. Then pushes are made one by one, either those with the largest expected information or any of the same
candidates, and after each the hypotheses are weighed anew on all that was recorded, until the true one has 0.95. A case
counts where the effect acted in one of its pushes at least: of a cord that stays slack in all, no push can tell.
Between pushes the table is held where it is; every push is a recording of its own, and all are laid end to end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bullet_sim.errors import SimError
from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import HandPath, HandPush
from bullet_sim.scene import Scene
from pbrl_bag.types import PoseStream, Recording, WrenchStream
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, Stage
from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import in_parallel
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.diagnose import fit_baselines, track_of
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.next_experiment.candidates import Reach
from pbrl_mismatch.next_experiment.experiment import NextExperiment, next_experiment, random_experiment
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.fitted import cut_stages
from pbrl_mismatch.search.library import search_library
from pbrl_mismatch.search.weigh import Weighed, weigh
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

GROUPS = (
    ("ground_friction", "viscous_drag", "floor_slope", "second_wheel"),
    ("floor_slope", "tether", "viscous_drag", "floor_patch"),
)
"""Effects that one short push does not tell apart."""
SEEDS, QUICK_TRUTHS = 8, 2
FIRST_SEED = 10_000
"""Scored seeds begin here; those below are for development."""
SURE = 0.95
MOST = 8
"""Pushes after which a case counts as not told; it then counts as one more than so many."""
STRENGTH = (0.0, 0.2)
"""Of the concealed effect, see `concealed.draws`."""
FIRST_SPEED, FIRST_SECONDS = 0.04, 1.0
"""Of the push that leaves both possible [m/s], [s]."""
RAMP = 0.2
TRIES = 12
"""Draws of a table and an effect before a case counts as one that one push tells at once."""
ROOM = 4.0
SPEEDS, DURATIONS = (0.02, 0.06), (0.6, 1.2)
BASELINE = ("free",)
UNUSABLE = (SimError, BringupError, MismatchError, ModelError)
"""What a push ends with that cannot be done, or whose recording is refused: it hardly moved, or slid in the hand."""
QUIET = {"draws": 120, "workers": 1, "most_together": 1}


@dataclass(frozen=True)
class Told:
    """How one case went.

    Attributes:
        group: effects among which it is.
        truth: the one that is true.
        seed: of the case.
        first: probability of the truth after the first push.
        chosen: pushes by expected information until the truth had 0.95.
        random: pushes at random.
        misled: whether a wrong hypothesis had 0.95 on the way, by how pushes were chosen.
        acted: whether the effect acted in any of all these pushes, from the simulator's truth.
        bits: expected of each chosen push.
    """

    group: tuple[str, ...]
    truth: str
    seed: int
    first: float
    chosen: int
    random: int
    misled: tuple[bool, bool]
    acted: bool
    bits: tuple[float, ...]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Run every group with each of its effects true."""
    told = [each for each in in_parallel(run_case, cases_of(seed, quick), "cases") if each is not None]
    figure([each for each in told if each.acted]).savefig(out / "figure.png", dpi=110)
    return Measured(rows_of(told), {"cases": [asdict(each) for each in told]})


def cases_of(seed: int, quick: bool) -> list[tuple[tuple[str, ...], str, int]]:
    """Return group, truth and seed of each case."""
    first = FIRST_SEED * (1 + seed)
    cases = [(group, truth) for group in GROUPS for truth in group]
    cases, seeds = (cases[:QUICK_TRUTHS], 1) if quick else (cases, SEEDS)
    return [(group, truth, first + number) for group, truth in cases for number in range(seeds)]


def run_case(group: tuple[str, ...], truth: str, seed: int) -> Told | None:
    """Push until the truth is known, in both ways; None where no draw leaves both possible after the first push."""
    for number in range(TRIES):
        rng = np.random.default_rng([seed, number, sum(map(ord, "".join(group) + truth))])
        try:
            table = _Table.drawn(rng, truth)
            first = table.pushed(_first_push(rng, table), 0)
            weighed, _ = weighed_by(first.recording, group, seed)
        except UNUSABLE:
            continue
        if max(each.probability for each in weighed) < SURE:
            run, other = (until_told(first, group, truth, seed, random=random) for random in (False, True))
            misled, acted = (run.misled, other.misled), run.acted or other.acted
            begun = _probability(weighed, truth)
            return Told(group, truth, seed, begun, run.pushes, other.pushes, misled, acted, run.bits)
    return None


@dataclass(frozen=True)
class _Table:
    """A table with something concealed, where it stands now, and all that was recorded of it.

    Attributes:
        scene: settings, the concealed part among them.
        pose: of the table.
        seed: of the simulation.
        recording: of all pushes so far; empty of episodes at first.
        acted: whether what is concealed acted in one of them.
    """

    scene: dict[str, object]
    pose: tuple[float, float, float]
    seed: int
    recording: Recording
    acted: bool = False

    @classmethod
    def drawn(cls, rng: np.random.Generator, truth: str) -> _Table:
        """Draw a table and a concealed effect that acts where it will be pushed."""
        size = [float(rng.uniform(0.6, 0.9)), float(rng.uniform(1.0, 1.5))]
        pose = (0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
        outline = [[-ROOM, -ROOM], [ROOM, -ROOM], [ROOM, ROOM], [-ROOM, ROOM]]
        mass = float(rng.uniform(16.0, 40.0))
        body = {"kind": "plain_table", "size": size, "nominal_mass": mass, "pose": list(pose)}
        scene: dict[str, object] = {"name": "next", "room": {"outline": outline}, "bodies": {NAME: body}}
        seed = int(rng.integers(2**31))
        way = HandPush(NAME, (-size[0] / 2.0, 0.0), _path(rng.uniform(-math.pi, math.pi), 0.1, 4.0))
        made = push_by_hand(Scene.model_validate(scene), (way,), seed=seed)
        stage = Stage({**scene, "concealed": {}}, (way,), seed, made.bodies[NAME])
        concealed = DRAWS[truth](rng, stage, float(rng.uniform(*STRENGTH)))
        concealed.pop("wheel", None)  # the baseline has none: with two of them no hypothesis would be true
        empty = replace(to_recording(made, Scene.model_validate(scene)), grasps=())
        return cls({**scene, "concealed": concealed}, pose, seed, empty)

    def pushed(self, push: HandPush, number: int) -> _Table:
        """Return the table after one push more.

        Raises:
            SimError: the push cannot be simulated.
        """
        body = {**self.scene["bodies"][NAME], "pose": list(self.pose)}  # type: ignore[index]
        scene = Scene.model_validate({**self.scene, "bodies": {NAME: body}})
        made = push_by_hand(scene, (push,), seed=self.seed + 1 + number)
        end = made.bodies[NAME].pose[-1]
        recording = to_recording(made, scene)
        joined = recording if not self.recording.grasps else laid_after(self.recording, recording)
        acted = self.acted or any(each.acting.any() for each in made.activities.values())
        return replace(self, pose=(float(end[0]), float(end[1]), float(end[2])), recording=joined, acted=acted)


def laid_after(first: Recording, second: Recording) -> Recording:
    """Return two recordings of the same objects as one, the second a second after the first."""
    last = [float(stream.time[-1]) for stream in first.object_poses.values()]
    last += [float(stream.time[-1]) for stream in first.wrenches.values()]
    late = float(math.ceil(max(last))) + 1.0

    def poses(a: PoseStream, b: PoseStream) -> PoseStream:
        return PoseStream(
            np.concatenate([a.time, b.time + late]),
            np.concatenate([a.position, b.position]),
            np.concatenate([a.quaternion, b.quaternion]),
        )

    def wrenches(a: WrenchStream, b: WrenchStream) -> WrenchStream:
        return replace(
            a,
            time=np.concatenate([a.time, b.time + late]),
            force=np.concatenate([a.force, b.force]),
            torque=np.concatenate([a.torque, b.torque]),
        )

    return replace(
        first,
        object_poses={name: poses(a, second.object_poses[name]) for name, a in first.object_poses.items()},
        gripper_poses={name: poses(a, second.gripper_poses[name]) for name, a in first.gripper_poses.items()},
        wrenches={name: wrenches(a, second.wrenches[name]) for name, a in first.wrenches.items()},
        grasps=(*first.grasps, *(replace(g, start=g.start + late, end=g.end + late) for g in second.grasps)),
    )


def weighed_by(recording: Recording, names: Sequence[str], seed: int) -> tuple[tuple[Weighed, ...], Track]:
    """Weigh nothing and each of some effects on a recording."""
    known = DiagnoseOptions()
    without = tuple(name for name in known.effects if name not in names)
    options = DiagnoseOptions(without=without, baseline=BASELINE, seed=seed, **QUIET)
    track = track_of(recording, NAME)
    stages = cut_stages(track, options)
    bases = fit_baselines(np.random.default_rng([seed, 1]), track, stages, options)
    tried = search_library(np.random.SeedSequence([seed, 2]), track, bases, stages, options)
    return weigh(bases, tried, options), track


@dataclass(frozen=True)
class _Run:
    """Pushes that it took until the truth was told, whether a wrong one was sure on the way, and `acted` of the table.

    Bits are what was expected of each push.
    """

    pushes: int
    misled: bool
    acted: bool
    bits: tuple[float, ...]


def until_told(table: _Table, group: Sequence[str], truth: str, seed: int, *, random: bool) -> _Run:
    """Push until the truth is told."""
    rng = np.random.default_rng([seed, 3, int(random)])
    reach = Reach(speeds=SPEEDS, durations=DURATIONS, room=table.recording.room)
    choose = random_experiment if random else next_experiment
    misled, bits = False, []
    weighed, track = weighed_by(table.recording, group, seed)
    for number in range(1, MOST + 1):
        plan = choose(rng, track, weighed, reach)
        if plan is None:
            break
        bits.append(plan.expected_bits)
        try:
            after = table.pushed(_as_push(plan), number)
            weighed, track = weighed_by(after.recording, group, seed)
        except UNUSABLE:  # what cannot be done, or read, was a push all the same
            continue
        table = after
        if _probability(weighed, truth) >= SURE:
            return _Run(number, misled, table.acted, tuple(bits))
        misled = misled or max(each.probability for each in weighed) >= SURE
    return _Run(MOST + 1, misled, table.acted, tuple(bits))


def _probability(weighed: Sequence[Weighed], truth: str) -> float:
    return sum(each.probability for each in weighed if each.effects == (truth,))


def _path(angle: float, speed: float, seconds: float) -> HandPath:
    """Return a straight path with a ramp at both ends."""
    time = np.array([0.0, RAMP, seconds - RAMP, seconds])
    along = speed * np.array([math.cos(angle), math.sin(angle), 0.0])
    return HandPath(time, np.outer([0.0, 1.0, 1.0, 0.0], along), "world")


def _first_push(rng: np.random.Generator, table: _Table) -> HandPush:
    """Draw a slow and straight push at the middle of an edge."""
    size = table.scene["bodies"][NAME]["size"]  # type: ignore[index]
    return HandPush(
        NAME, (-size[0] / 2.0, 0.0), _path(float(rng.uniform(-math.pi, math.pi)), FIRST_SPEED, FIRST_SECONDS)
    )


def _as_push(plan: NextExperiment) -> HandPush:
    angle = math.atan2(plan.direction[1], plan.direction[0])
    return HandPush(NAME, plan.contact_point, _path(angle, plan.speed, plan.duration))


def rows_of(told: Sequence[Told]) -> list[Row]:
    """Return the acceptance row, and how often a wrong hypothesis was sure on the way; of cases in which it acted."""
    counted = [each for each in told if each.acted]
    chosen, at_random = (np.array([getattr(each, how) for each in counted], float) for how in ("chosen", "random"))
    if not counted:
        return [at_most("pushes until the truth has 0.95, chosen over random", math.nan, "1", 0.5)]
    middle = float(np.median(at_random))
    return [
        at_most(
            f"pushes until the truth has 0.95, median of {len(counted)} cases, chosen by expected information",
            float(np.median(chosen)),
            "1",
            0.5 * middle,
            random=middle,
            mean=float(chosen.mean()),
            mean_random=float(at_random.mean()),
            never_acted=float(len(told) - len(counted)),
            median_of_all=float(np.median([each.chosen for each in told])),
            median_of_all_random=float(np.median([each.random for each in told])),
        ),
        at_least(
            f"told within {MOST} pushes, share of cases",
            float(np.mean(chosen <= MOST)),
            "1",
            0.9,
            random=float(np.mean(at_random <= MOST)),
        ),
        at_most(
            "a wrong hypothesis had 0.95 on the way, share of cases",
            float(np.mean([each.misled[0] for each in counted])),
            "1",
            0.05,
            random=float(np.mean([each.misled[1] for each in counted])),
        ),
    ]


def figure(told: Sequence[Told]) -> Figure:
    """Draw the share of cases that are told after so many pushes."""
    page = Figure(figsize=(6.0, 3.6), layout="constrained")
    axes = page.subplots()
    pushes = np.arange(MOST + 1)
    for how, label, line in (
        ("chosen", "chosen by expected information", {"linewidth": 4.0, "alpha": 0.6}),
        ("random", "at random", {"linestyle": "--"}),
    ):
        counts = np.array([getattr(each, how) for each in told])
        share = [float(np.mean(counts <= n)) if len(counts) else 0.0 for n in pushes]
        axes.step(pushes, share, where="post", label=label, **line)
    axes.set_xlabel("pushes after the first")
    axes.set_ylabel("share of cases in which the truth has 0.95")
    axes.set_ylim(0.0, 1.05)
    axes.legend(loc="lower right")
    axes.set_title(f"Pushes until it is known what was left out, {len(told)} cases", fontsize=10)
    return page
