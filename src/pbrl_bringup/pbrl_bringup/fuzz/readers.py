"""Everything that reads a file, each with a corpus, and what is done with what was read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bullet_sim.model_file import concealed_of
from bullet_sim.scene import load_scene
from bullet_sim.tag_sheet import load_tag_sheet as load_simulated_tags
from pbrl_bag import cut_episodes, describe, read_recording
from pbrl_bag.mapping import load_mapping
from pbrl_bag.playback import load_bag
from pbrl_bag.proposing import mapping_text, propose
from pbrl_bringup.cli.errors import errors_of_ours
from pbrl_bringup.commands.export import command as export
from pbrl_bringup.experiments.household import load_household
from pbrl_bringup.files import write_text
from pbrl_bringup.fuzz import corpus
from pbrl_bringup.fuzz.byte_mutations import mutate_bytes, mutate_text
from pbrl_bringup.fuzz.corpus import Files
from pbrl_bringup.fuzz.text_mutations import mutate_table, mutate_xml
from pbrl_bringup.fuzz.tree_mutations import mutate_json, mutate_yaml
from pbrl_bringup.graph import load_graph, node_command
from pbrl_bringup.view.bag import read_shown
from pbrl_bringup.view.diagnosed import read_diagnosed, regions_of, sentences
from pbrl_bringup.view.learned import model_files
from pbrl_bringup.view.server import MOST_SAMPLES
from pbrl_control.ball_arm import BallArm
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.push_plan import load_plan
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.trajectories.trajectory_plan import load_trajectory
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.repaired import load_repaired
from pbrl_model.agents.domain_file import load_domain
from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.errors import ModelError
from pbrl_model.prior_options import load_prior_options
from pbrl_model.tags.sheet import load_tag_sheet, worn_tags
from pbrl_namo.scenes import load_svg
from pbrl_planner.cart.settings import load_cart
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.cfg_file import read_environment
from pbrl_planner.lattice.mprim_file import read_primitives
from pbrl_planner.lattice.ros_map import read_map
from pbrl_planner.tabletop import Desk, Item, Objective, Table
from pbrl_planner.tabletop.knowledge import Knowledge
from pbrl_planner.tabletop.primitives import PRIMITIVES
from pr2_cart_sim.maps import load_map
from pr2_cart_sim.scene import load_office
from tabletop_sim.scene import load_desk

MUTATIONS = {".yaml": mutate_yaml, ".json": mutate_json, ".svg": mutate_xml, ".urdf": mutate_xml, ".csv": mutate_table}
MUTATIONS |= dict.fromkeys((".mprim", ".cfg"), mutate_text)
"""By what a file ends with; all others are bytes."""


@dataclass(frozen=True)
class Reader:
    """What reads one kind of file.

    Attributes:
        corpus: makes valid inputs.
        read: reads the input in a folder, and writes what it has to write into another.
    """

    corpus: Callable[[], Sequence[Files]]
    read: Callable[[Path, Path], object]


class FileSubject:
    """A reader with its corpus, and folders for its inputs and what it writes.

    Args:
        reader: it.
        place: where the folders `in` and `out` are made.
    """

    def __init__(self, reader: Reader, place: Path) -> None:
        self._read, self._known = reader.read, list(reader.corpus())
        self._source, self._out = place / "in", place / "out"
        for files in self._known:  # libraries are loaded, and what they make once is made
            self._lay(files)
            with suppress(*errors_of_ours()):
                self.read(None)

    def make(self, rng: np.random.Generator) -> None:
        """Lay an input: one of the corpus, one of its files mutated, now and then another one as well."""
        self._lay(self.hostile(rng))

    def _lay(self, files: Files) -> None:
        lay(files, self._source)
        shutil.rmtree(self._out, ignore_errors=True)
        self._out.mkdir(parents=True)

    def hostile(self, rng: np.random.Generator) -> dict[str, bytes]:
        """Return an input by file."""
        files = dict(self._known[rng.integers(len(self._known))])
        several = 1 if rng.random() < 0.8 else min(2, len(files))
        for name in map(str, rng.choice(list(files), several, replace=False)):
            others = [each[name] for each in self._known if name in each]
            files[name] = MUTATIONS.get(Path(name).suffix, mutate_bytes)(files[name], rng, others)
        return files

    def read(self, _: None) -> None:
        """Read what lies there."""
        self._read(self._source, self._out)


def lay(files: Files, folder: Path) -> None:
    """Write an input into a folder that has nothing else."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def _bag(name: str, folder: Path, _: Path) -> None:
    """As info, fit and view read a bag."""
    path = folder / name
    describe(path)
    shown = read_shown(path, None)
    json.dumps([shown.data(), shown.detail(-1e9, 1e9, MOST_SAMPLES)], allow_nan=False)
    cut_episodes(read_recording(path))


def _played(folder: Path, _: Path) -> None:
    load_bag(folder / "plain.mcap")


def _proposed(name: str, folder: Path, out: Path) -> None:
    """As map does: a mapping is proposed, and the bag is read with it."""
    proposal = propose(folder / name)
    if proposal.mapping is not None:
        sizes = dict.fromkeys(proposal.mapping.object_poses, (1.0, 0.8))
        write_text(out / "proposed.yaml", mapping_text(proposal, name, sizes))
        read_recording(folder / name, out / "proposed.yaml")


def _mapped(name: str, folder: Path, _: Path) -> None:
    load_mapping(folder / "map.yaml")
    cut_episodes(read_recording(folder / name, folder / "map.yaml"))


def _graph(folder: Path, _: Path) -> None:
    for name, node in load_graph(str(folder / "x.yaml")).nodes.items():
        node_command(name, node)


def _controller(folder: Path, _: Path) -> None:
    load_section(folder / "x.yaml", ControllerSettings, "settings")


def _objective(folder: Path, _: Path) -> None:
    layout = np.array([[0.1, 0.0, 0.0], [-0.1, 0.1, 1.0], [0.2, -0.1, 2.0]])
    try:
        Objective.from_file(DESK, folder / "x.yaml")(layout)
    except PlannerError:
        Objective.from_text(DESK, (folder / "x.yaml").read_bytes().decode("utf-8", "replace"))(layout)


DESK = Desk(
    Table(np.array([-0.5, -0.5]), np.array([0.5, 0.5])),
    tuple(Item(name, 0.1, 0.05) for name in ("eraser", "stapler", "pen")),
)


def _tags(folder: Path, _: Path) -> None:
    """Both readers, of the simulators' side and of the learners'."""
    try:
        load_simulated_tags(folder / "x.yaml")
    finally:
        worn_tags(load_tag_sheet(folder / "x.yaml"), ["table_a", "table_b"])


def _model(folder: Path, out: Path) -> None:
    """As view, export and a simulator read a model."""
    path = folder / "model_table.json"
    for use in (lambda: load_repaired(path), lambda: load_posterior(path)):
        try:
            use()
        except (ModelError, MismatchError):
            continue
    model_files([path])
    for form in ("urdf", "sdf", "json", "netcdf"):
        export(path, form, out / f"table.{form}", 0.75, None)


def _concealed(folder: Path, _: Path) -> None:
    concealed_of(folder / "model_table.json", load_scene("locked_caster").bodies, "table_a")


def _report(folder: Path, _: Path) -> None:
    found = read_diagnosed(folder / "report.json")
    page = {
        "regions": regions_of(found.report, ["table"], 0.5),
        "said": sentences(found.report),
        "residuals": {name: each.model_dump() for name, each in found.residuals.items()},
    }
    json.dumps(page, allow_nan=False)


def _knowledge(kind: str, folder: Path, _: Path) -> None:
    Knowledge(kind, (0.05,), file=folder / f"{kind}.json").is_taught(DESK)


def _tables() -> list[Files]:
    row = {
        "primitive": PRIMITIVES[0],
        "travel": 0.05,
        "count": 3,
        "mean": [0.0, 0.05, 0.0],
        "variance": [1e-6, 1e-6, 1e-4],
    }
    return [{"tables.json": json.dumps({"eraser": [row, row]}).encode()}]


def _household(folder: Path, _: Path) -> None:
    load_household(str(folder / "x.yaml"))


def _arm(folder: Path, _: Path) -> None:
    BallArm((folder / "x.urdf").read_bytes().decode("utf-8", "replace"), np.zeros(3))


def _krang(folder: Path, _: Path) -> None:
    RobotKinematics((folder / "x.urdf").read_bytes().decode("utf-8", "replace"))


def _at(read: Callable[[Path], Any], name: str) -> Callable[[Path, Path], object]:
    return lambda folder, _: read(folder / name)


def _urdf(name: str) -> Callable[[], list[Files]]:
    return lambda: [{"x.urdf": corpus.description(name)}]


def _yaml(folder: str) -> Callable[[], list[Files]]:
    return partial(corpus.config, folder, "x.yaml")


READERS: dict[str, Reader] = {
    "MCAP bag": Reader(lambda: corpus.bags()["mcap"], partial(_bag, "bag")),
    "MCAP bag not packed": Reader(lambda: corpus.bags()["plain"], partial(_bag, "plain.mcap")),
    "bag to be played": Reader(lambda: corpus.bags()["plain"], _played),
    "SQLite bag": Reader(lambda: corpus.bags()["sqlite"], partial(_bag, "bag")),
    "ROS 1 bag": Reader(lambda: corpus.bags()["ros1"], partial(_bag, "old.bag")),
    "bag with proposed mapping": Reader(lambda: corpus.bags()["plain"], partial(_proposed, "plain.mcap")),
    "bag with mapping": Reader(corpus.mapped_bags, partial(_mapped, "plain.mcap")),
    "table with mapping": Reader(corpus.tables, partial(_mapped, "pull.csv")),
    "mapping": Reader(_yaml("mappings"), _at(load_mapping, "x.yaml")),
    "scene": Reader(_yaml("scenes"), _at(load_scene, "x.yaml")),
    "office": Reader(corpus.offices, _at(load_office, "x.yaml")),
    "desk": Reader(_yaml("desks"), _at(load_desk, "x.yaml")),
    "objective": Reader(_yaml("objectives"), _objective),
    "graph": Reader(_yaml("params/graphs"), _graph),
    "controller settings": Reader(partial(corpus.config_file, "params/body_controller.yaml", "x.yaml"), _controller),
    "cart settings": Reader(partial(corpus.config_file, "params/cart.yaml", "x.yaml"), _at(load_cart, "x.yaml")),
    "push plan": Reader(_yaml("params/pushes"), _at(load_plan, "x.yaml")),
    "trajectory": Reader(_yaml("params/trajectories"), _at(load_trajectory, "x.yaml")),
    "priors": Reader(partial(corpus.config_file, "params/priors.yaml", "x.yaml"), _at(load_prior_options, "x.yaml")),
    "tags": Reader(partial(corpus.config_file, "params/tags.yaml", "x.yaml"), _tags),
    "agent's domain": Reader(corpus.domains, _at(load_domain, "x.yaml")),
    "household": Reader(partial(corpus.config_file, "experiments/household.yaml", "x.yaml"), _household),
    "map": Reader(corpus.maps, _at(read_map, "map.yaml")),
    "map in simulator": Reader(corpus.maps, _at(load_map, "map.yaml")),
    "model": Reader(corpus.models, _model),
    "model in simulator": Reader(corpus.models, _concealed),
    "posterior": Reader(corpus.posteriors, _at(load_posterior, "posterior_table.nc")),
    "report": Reader(corpus.reports, _report),
    "drawing": Reader(partial(corpus.tests_data, "namo_scenes/*.svg", "x.svg"), _at(load_svg, "x.svg")),
    "primitives": Reader(corpus.primitives, _at(read_primitives, "a.mprim")),
    "environment": Reader(corpus.environments, _at(read_environment, "a.cfg")),
    "pushes learned": Reader(_tables, partial(_knowledge, "tables")),
    "arm": Reader(_urdf("ball_arm/ball_arm.urdf"), _arm),
    "robot": Reader(_urdf("krang/krang.urdf"), _krang),
}
