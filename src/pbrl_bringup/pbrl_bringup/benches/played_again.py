"""What is learned live and what is learned from the recording of it, played again: number for number the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point, Vector3
from numpy.typing import NDArray
from pbrl_msgs.srv import LearnModel, PushObject

from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import new_folder_place
from pbrl_bringup.graph import Node, Scalar, free_domain, node_command, node_environment
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient
from pbrl_model.ros.conversions import models_from_msg

Array = NDArray[np.float64]

STREAMS = ("/wrist_ft/left", "/ar_tags/table_a/pose", "/ar_tags/left_gripper/pose", "/grasps", "/scene")
"""Topics that are learned from."""
PUSHES = (
    PushObject.Request(
        object="table_a",
        contact_point=Point(x=-0.375, y=0.2),
        direction=Vector3(x=1.0, y=0.2),
        speed=0.08,
        duration=6.0,
    ),
    PushObject.Request(
        object="table_a", contact_point=Point(x=-0.375, y=-0.3), direction=Vector3(x=1.0), speed=0.06, duration=6.0
    ),
)
RATES = {"as it was": 1.0, "three times as fast": 3.0}
"""At which the recording is played."""
PATIENCE, LONG = 60.0, 300.0
"""[s] until nodes are there, and until something is pushed or learned."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Push and learn live, then learn from the recording."""
    bag = out / "bag"
    new_folder_place(bag)
    live = learned_live(seed, PUSHES[: 1 if quick else None], bag, out / "logs")
    rows = [at_least("numbers in the samples that were learned live", live.size, "1", 1)]
    for name, rate in list(RATES.items())[: 1 if quick else None]:
        again = learned_again(seed, rate, bag, out / "logs")
        differing = int(np.sum(live != again)) if again.shape == live.shape else live.size
        rows.append(at_most(f"of them other than from the recording, played {name}", differing, "1", 0))
    return Measured(rows, {"mean": live.mean(axis=0).tolist()})


def learned_live(seed: int, pushes: tuple[PushObject.Request, ...], bag: Path, logs: Path) -> Array:
    """Return the samples (n, parameters) of what was learned while a hand pushed; all of it is recorded."""
    hand = Node(package="krang_sim", executable="hand_node", parameters={"scene": "locked_caster", "seed": seed})
    recorder = Node(package="pbrl_bag", executable="recorder_node", parameters={"output": str(bag)})
    with free_domain() as domain, Programs(logs, node_environment(domain)) as programs:
        programs.start("model", node_command("model", model()))
        programs.start("recorder", node_command("recorder", recorder))
        programs.start("hand", node_command("hand", hand))
        with GraphClient(domain, programs.check) as client:
            client.wait_for_service("/learn", PATIENCE)
            for topic in STREAMS:
                client.wait_for_subscribers(topic, 2, PATIENCE)
            for push in pushes:
                done = client.call(PushObject, "/push", push, LONG)
                if not done.success:
                    raise BringupError(f"the push failed: {done.message}")
            programs.stop("hand")
            programs.stop("recorder")
            return learned(client, seed)


def learned_again(seed: int, rate: float, bag: Path, logs: Path) -> Array:
    """Return the samples of what is learned while the recording is played."""
    parameters: dict[str, Scalar] = {"bag": str(bag), "rate": rate, "wait_for": list(STREAMS)}
    player = Node(package="pbrl_bag", executable="player_node", parameters=parameters)
    with free_domain() as domain, Programs(logs, node_environment(domain)) as programs:
        programs.start("model_again", node_command("model", model()))
        with GraphClient(domain) as client:
            client.wait_for_service("/learn", PATIENCE)
            programs.start("player", node_command("player", player))
            if not programs.ended("player", LONG):
                raise BringupError(f"the player has not come to the end of {bag} after {LONG:.0f} s")
            return learned(client, seed)


def model() -> Node:
    """Return a model node that learns when it is asked to."""
    return Node(package="pbrl_model", executable="model_node", parameters={"online": False})


def learned(client: GraphClient, seed: int) -> Array:
    """Have what was heard learned from, and return the samples (n, parameters)."""
    answer = client.call(LearnModel, "/learn", LearnModel.Request(seed=seed), LONG)
    if not answer.success:
        raise BringupError(f"model_node could not learn: {answer.message}")
    return models_from_msg(answer.models)["table_a"].flat
