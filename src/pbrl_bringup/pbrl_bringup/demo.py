"""The demo: real nodes, one push, one recording, one fit, one page.

What the simulator conceals is read only after the posterior has come over its topic, and is drawn on
the page as what it is: the answer, for comparison.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pbrl_msgs.msg import ObjectModels
from pbrl_msgs.srv import LearnModel
from std_msgs.msg import String

from bullet_sim.catalogue import OfficeTable
from bullet_sim.scene import load_scene
from pbrl_bag import Recording, read_recording
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import output_folder, write_json
from pbrl_bringup.graph import free_domain, load_graph, node_command, node_environment, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_bringup.replay import replay
from pbrl_bringup.report_build import object_report, whole_report
from pbrl_bringup.report_data import Point, Report
from pbrl_bringup.report_page import write_page
from pbrl_bringup.ros.client import GraphClient, Heard
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.geometry import mass_properties
from pbrl_model.posterior import Posterior
from pbrl_model.ros.conversions import models_from_msg

TITLE = "Demo: Krang pushes a table whose physics it does not know"
SCENE = "locked_caster"
PLAN = "turn_table"
START_TIME = 60.0  # [s] until every node is there; the first start compiles Python
PUSH_TIME = 120.0  # [s]
LEARN_TIME = 240.0  # [s]; the first fit compiles the kernels
PHASES = {
    "approach": "Krang drives up to the table",
    "grasp": "closes its gripper on the edge",
    "settle": "stands still, holding",
    "push": "pushes",
    "release": "lets go",
    "retreat": "backs off",
}
Say = Callable[[str], None]


@dataclass(frozen=True)
class DemoSettings:
    """What a run of the demo is made of."""

    out: Path
    seed: int
    gui: bool
    scene: str = SCENE
    plan: str = PLAN
    command: str = "./pbrl demo"


def run_demo(settings: DemoSettings, say: Say) -> Path:
    """Run the demo and return the path of the page.

    Raises:
        BringupError: a node died, or something took too long.
        BagError: the recording is not as it should be.
    """
    started = time.monotonic()
    say("1 starting simulator, controller, recorder and model node")
    bag = fresh_bag(settings.out)
    posteriors = push_and_learn(settings, bag, say)
    say("4 writing the page")
    recording = read_recording(bag)
    report = demo_report(settings, recording, posteriors, time.monotonic() - started)
    write_json(settings.out / "report.json", fit_summary(bag, posteriors, time.monotonic() - started))
    page = settings.out / "report.html"
    write_page(report, page)
    say(f"  {report.verdict}")
    for line in filter(None, [report.detail, truth_line(report)]):
        say(f"  {line}")
    return page


def fresh_bag(out: Path) -> Path:
    """Return the name of a recording that does not exist; the one of an earlier demo is removed."""
    bag = out / "bag"
    if bag.exists():
        if not (bag / "metadata.yaml").is_file():
            raise BringupError(
                f"{bag}: expected the recording of an earlier demo, got something else; choose another --out"
            )
        shutil.rmtree(bag)
    return bag


def push_and_learn(settings: DemoSettings, bag: Path, say: Say) -> dict[str, Posterior]:
    """Start the nodes, have the push performed and recorded, and learn from the recording."""
    parameters = {
        "sim.scene": settings.scene,
        "sim.seed": str(settings.seed),
        "sim.gui": str(settings.gui).lower(),
        "recorder.output": str(bag),
        "push.plan": settings.plan,
    }
    graph = with_parameters(load_graph("krang_push"), parameters)
    commands = {name: node_command(name, node) for name, node in graph.nodes.items()}
    with free_domain() as domain, Programs(output_folder(settings.out / "logs"), node_environment(domain)) as programs:
        for name, command in commands.items():
            if name != "push":
                programs.start(name, command)
        with GraphClient(domain, programs.check) as client:
            status, models = client.listen(String, "/push/status"), client.listen(ObjectModels, "/object_models")
            for service in ("/grasp", "/learn"):
                client.wait_for_service(service, START_TIME)
            client.wait_for_topic("/body_controller/status", START_TIME)
            client.wait_until(lambda: any(bag.glob("*.mcap")), START_TIME, "the recorder made no file")
            say("2 the push")
            programs.start("push", commands["push"])
            watch_push(client, status, say)
            # The bag is closed first; then whoever has nothing left to do makes room for the fit.
            for name in ("recorder", "push", "controller", "sim"):
                programs.stop(name)
            say("3 learning from the recording")
            return learn(client, models, bag, settings.seed)


def watch_push(client: GraphClient, status: Heard, say: Say) -> None:
    """Tell every phase of the push, and wait for its end.

    Raises:
        BringupError: it failed.
    """
    told: set[str] = set()

    def ended() -> bool:
        phase = status.message.data if status.message else ""
        if phase in PHASES and phase not in told:
            told.add(phase)
            say(f"  {PHASES[phase]}")
        return phase == "done" or phase.startswith("failed")

    client.wait_until(ended, PUSH_TIME, "the push has not ended")
    if status.message.data != "done":
        raise BringupError(f"the push {status.message.data}")


def learn(client: GraphClient, models: Heard, bag: Path, seed: int) -> dict[str, Posterior]:
    """Call /learn on the recording, and take the posterior from its topic.

    Raises:
        BringupError: the node could not learn, or did not publish.
    """
    request = LearnModel.Request(recording=str(bag.resolve()), seed=seed)
    answer = client.call(LearnModel, "/learn", request, LEARN_TIME)
    if not answer.success:
        raise BringupError(f"model_node could not learn: {answer.message}")
    client.wait_until(
        lambda: bool(models.message and models.message.models), START_TIME, "no model came over /object_models"
    )
    return models_from_msg(models.message)


def demo_report(
    settings: DemoSettings, recording: Recording, posteriors: dict[str, Posterior], seconds: float
) -> Report:
    """Put the page together; only here, after the fit, the scene's concealed part is looked at."""
    rng = np.random.default_rng(settings.seed)
    objects = []
    for name, posterior in posteriors.items():
        motions = motions_of(recording, name)
        replays = replay(recording, motions, posterior, mass_properties(recording.bodies[name].footprint), rng)
        locked = locked_casters(settings.scene, name)
        objects.append(object_report(recording.bodies[name], posterior, replays, None, rng, locked))
    command = f"{settings.command} --seed {settings.seed}"
    return whole_report(TITLE, recording, objects, command, settings.seed, seconds)


def locked_casters(scene: str, name: str) -> list[Point] | None:
    """Return where the casters are that a scene locks under a body [m]; None where it says nothing of it."""
    loaded = load_scene(scene)
    body = loaded.bodies.get(name)
    locked = loaded.concealed.locked_casters.get(name)
    if locked is None or not isinstance(body, OfficeTable):
        return None
    return [body.swivels[caster] for caster in locked]


def truth_line(report: Report) -> str:
    """Say how far the place found is from the caster that was locked, where that is known."""
    truth = report.objects[0].truth if report.objects else None
    if truth is None or truth.distance is None:
        return ""
    return f"The simulator, asked now: it had locked a caster {100 * truth.distance:.1f} cm from there."


def fit_summary(bag: Path, posteriors: dict[str, Posterior], seconds: float) -> dict[str, object]:
    """Return `report.json` in the form of `./pbrl fit`."""
    objects = {
        name: {
            "parameters": posterior.summary(),
            "log_evidence": posterior.log_evidence,
            "heldout": {"rmse_position_m": posterior.heldout_rmse},
        }
        for name, posterior in posteriors.items()
    }
    return {"recording": str(bag), "objects": objects, "seconds": round(seconds, 2)}
