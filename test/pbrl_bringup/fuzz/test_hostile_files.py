"""Files that fuzzing found to break a reader, smallest form of each: now they are refused in a line."""

from __future__ import annotations

import os
import resource
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bullet_sim.errors import SimError
from bullet_sim.scene import load_scene
from pbrl_bag import describe, read_recording
from pbrl_bag.errors import BagError
from pbrl_bringup.commands.export import command as export
from pbrl_bringup.errors import BringupError
from pbrl_bringup.fuzz.corpus import config, maps, png, posteriors, saved
from pbrl_bringup.fuzz.push_seed import encoded, plain_mcap, push
from pbrl_bringup.paths import node_executable
from pbrl_bringup.view.models import told_model
from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.errors import ModelError
from pbrl_model.model_file import save_model
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.ros_map import read_map
from pbrl_planner.tabletop.knowledge import Knowledge
from pr2_cart_sim.maps import load_map
from tabletop_sim.scene import load_desk

WHOLE = dict(maps()[0])
IMAGE = WHOLE["map.png"]
WRONG_LENGTH = IMAGE.replace(IMAGE[33:41], b"\x80\0\0\0IDAT")
ROWS = (b"\0" + bytes(20)) * 20
READERS: list[Any] = [(read_map, PlannerError), (load_map, SimError)]


@pytest.mark.parametrize(("read", "error"), READERS, ids=["planner", "simulator"])
@pytest.mark.parametrize(
    "image",
    [
        WRONG_LENGTH,
        IMAGE[:39],
        IMAGE[:-12],
        IMAGE[:-4] + b"\0\0\0\0",
        png(2**31 - 1, 2**31 - 1, b""),
        png(100_000, 100_000, b""),
        png(0, 0, b""),
        b"P5 999999999 999999999 255\n",
        b"P5 20 20 255\n",
        b"BM" + bytes(200),
        b"",
    ],
    ids=["length", "cut off", "no end", "checksum", "huge", "large", "none", "huge PGM", "cut PGM", "BMP", "empty"],
)
def test_an_image_of_a_map_is_looked_at_before_it_is_unpacked(
    image: bytes, read: Callable[[Path], object], error: type[Exception], tmp_path: Path
) -> None:
    name = "map.pgm" if image[:1] == b"P" else "map.png"
    (tmp_path / "map.yaml").write_bytes(WHOLE["map.yaml"].replace(b"map.png", name.encode()))
    (tmp_path / name).write_bytes(image)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(error, match=name):
        read(tmp_path / "map.yaml")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB


@pytest.mark.parametrize(("read", "error"), READERS, ids=["planner", "simulator"])
@pytest.mark.parametrize("name", ["/dev/zero", "/dev/stdin", ".", "x" * 300, "a\0b", "pipe"])
def test_devices_and_pipes_are_no_maps(
    name: str, read: Callable[[Path], object], error: type[Exception], tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "map.yaml").write_text(yaml.safe_dump({**yaml.safe_load(WHOLE["map.yaml"]), "image": name}))
    with pytest.raises(error):
        read(tmp_path / "map.yaml")


@pytest.mark.parametrize(("read", "error"), READERS, ids=["planner", "simulator"])
def test_a_picture_with_texts_and_frames_beside_it_is_read(
    read: Callable[[Path], Any], error: type[Exception], tmp_path: Path
) -> None:
    extra = png(1, 1, b"\0\0")[8:33].replace(b"IHDR", b"teXt")
    other = b"\0\0\0\x02acTL\0\0" + zlib.crc32(b"acTL\0\0").to_bytes(4, "big")
    (tmp_path / "map.yaml").write_bytes(WHOLE["map.yaml"])
    (tmp_path / "map.png").write_bytes(IMAGE[:33] + other + IMAGE[33:])
    assert read(tmp_path / "map.yaml").cells.shape == (20, 20)
    (tmp_path / "map.png").write_bytes(IMAGE[:33] + extra + IMAGE[33:])
    with pytest.raises(error):
        read(tmp_path / "map.yaml")


@pytest.mark.parametrize("executable", ["../../../bin/sh", "/bin/sh", "x" * 300, "a\0b", "", "..", "recorder_node²"])
def test_a_graph_starts_executables_of_packages_only(executable: str) -> None:
    with pytest.raises(BringupError, match="executable"):
        node_executable("pbrl_bag", executable)
    with pytest.raises(BringupError, match="package"):
        node_executable(f"pbrl_bag/{executable}", "recorder_node")


def test_a_kind_that_is_a_list_is_no_kind(tmp_path: Path) -> None:
    desk = yaml.safe_load(config("desks", "x.yaml")[0]["x.yaml"])
    desk["items"][next(iter(desk["items"]))]["kind"] = ["eraser"]
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(desk))
    with pytest.raises(SimError, match="kind"):
        load_desk(tmp_path / "x.yaml")


def test_a_body_whose_topics_no_graph_could_have_is_refused(tmp_path: Path) -> None:
    scene = yaml.safe_load(config("scenes", "x.yaml")[0]["x.yaml"])
    body = scene["bodies"].pop(next(iter(scene["bodies"])))
    scene["bodies"]["x" * 101] = body
    (tmp_path / "x.yaml").write_text(yaml.safe_dump({"room": scene["room"], "bodies": scene["bodies"]}))
    with pytest.raises(SimError, match="letters, digits and underscores"):
        load_scene(tmp_path / "x.yaml")


def test_posteriors_damaged_anywhere_are_refused(tmp_path: Path) -> None:
    whole = posteriors()[0]["posterior_table.nc"]
    path = tmp_path / "x.nc"
    for at in range(0, min(len(whole), 4000), 97):
        path.write_bytes(whole[:at] + bytes(8 * [255]) + whole[at + 8 :])
        try:
            load_posterior(path)
        except ModelError as error:
            assert str(path) in str(error)


def test_a_posterior_whose_numbers_cannot_be_unpacked_is_refused(tmp_path: Path) -> None:
    """A damaged chunk shows when numbers are read, after the file was opened."""
    whole = posteriors()[0]["posterior_table.nc"]
    path, said = tmp_path / "x.nc", ""
    for at in range(4000, len(whole), 499):
        path.write_bytes(whole[:at] + bytes(64 * [255]) + whole[at + 64 :])
        try:
            load_posterior(path)
        except ModelError as error:
            said += str(error)
    assert "filter returned failure" in said


def test_draws_that_cannot_be_rounded_are_told_and_not_drawn() -> None:
    draws = {name: np.full(10, 1e306) for name in ("wheel_x", "wheel_y", "wheel_theta")}
    told = told_model("caster", [("wheel_x", 1e306, 0.0, "m")], draws)
    assert told["wheel"] is None and "wheel_x 1e+306" in told["told"]


@pytest.mark.parametrize("text", ["[" * 100_000, '{"eraser": [{"count": 1, "mean": [1' + "0" * 400 + "]}]}"])
def test_pushes_learned_of_no_sense_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "tables.json").write_text(text)
    with pytest.raises(PlannerError, match=r"tables\.json"):
        Knowledge("tables", (0.05,), file=tmp_path / "tables.json")


def test_a_text_that_netcdf_cannot_hold_is_told(tmp_path: Path) -> None:
    save_model(saved("tether").model_copy(update={"object": "a\0b"}), tmp_path / "model.json")
    with pytest.raises(ModelError, match="expected to write a posterior"):
        export(tmp_path / "model.json", "netcdf", tmp_path / "x.nc", 0.75, None)
    assert list(tmp_path.iterdir()) == [tmp_path / "model.json"]


@pytest.mark.parametrize("when", [0, 2**63, 2**64 - 1])
def test_time_stamps_of_64_bits_are_told_of(when: int, tmp_path: Path) -> None:
    messages = [(*message[:3], when if k == 0 else message[3]) for k, message in enumerate(encoded(push()))]
    (tmp_path / "x.mcap").write_bytes(plain_mcap(messages))  # type: ignore[arg-type]
    assert describe(tmp_path / "x.mcap").message_count == len(messages)
    try:
        read_recording(tmp_path / "x.mcap")
    except BagError as error:
        assert "x.mcap" in str(error)
