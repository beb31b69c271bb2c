"""Valid files of every kind, small ones: from the workspace's configuration and tests, or made on the spot."""

from __future__ import annotations

import json
import struct
import tempfile
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from ament_index_python.packages import get_package_share_directory

from pbrl_bringup.benches.foreign import write as write_foreign
from pbrl_bringup.fuzz import push_seed
from pbrl_bringup.fuzz.tree_mutations import yaml_of
from pbrl_bringup.paths import workspace
from pbrl_model.arviz_bridge import save_posterior
from pbrl_model.model_file import LearnedEffect, SavedModel, Shape, learned, posterior_of

Files = Mapping[str, bytes]
"""An input: content by name, below one folder."""


def config(folder: str, name: str) -> list[Files]:
    """Return the YAML files of a folder of the configuration, without their comments, each called `name`."""
    found = sorted((Path(get_package_share_directory("pbrl_config")) / folder).glob("*.yaml"))
    return [{name: compact(file.read_bytes())} for file in found]


def config_file(path: str, name: str) -> list[Files]:
    """Return one YAML file of the configuration likewise."""
    return [{name: compact((Path(get_package_share_directory("pbrl_config")) / path).read_bytes())}]


def compact(data: bytes) -> bytes:
    """Return YAML without comments."""
    return str(yaml.safe_dump(yaml_of(data), sort_keys=False, default_flow_style=None)).encode()


def tests_data(pattern: str, name: str) -> list[Files]:
    """Return files below `test/data`, each called `name`."""
    return [{name: file.read_bytes()} for file in sorted((workspace() / "test/data").glob(pattern))]


@cache
def bags() -> Mapping[str, list[Files]]:
    """Return bags of the same push by storage: `mcap`, `sqlite`, `ros1`; and `plain`, an MCAP with nothing packed."""
    messages = push_seed.push()
    known = [message for message in messages if "pbrl_msgs" not in message[1] and "Marker" not in message[1]]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        push_seed.ours(folder / "ours", messages)
        write_foreign(folder / "sqlite", "sqlite", known)
        write_foreign(folder / "old", "ros1", known)
        return {
            "mcap": [_tree(folder / "ours", "bag")],
            "sqlite": [_tree(folder / "sqlite", "bag")],
            "ros1": [{"old.bag": (folder / "old.bag").read_bytes()}],
            "plain": [{"plain.mcap": push_seed.plain_mcap(push_seed.encoded(messages))}],
        }


def _tree(folder: Path, name: str) -> Files:
    return {f"{name}/{file.relative_to(folder)}": file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def tables() -> list[Files]:
    """Return a CSV recording with its mapping."""
    mapping = {
        "time": {"column": "t"},
        "bodies": {"door": {"footprint": [[0, 0], [1, 0], [1, 0.05], [0, 0.05]], "height": 1.0, "theta": 0.0}},
        "object_poses": {"door": {"position": ["x", "y", 0.7], "yaw": "yaw"}},
        "gripper_poses": {"left": {"position": ["gx", "y", 0.7], "orientation": [0, 0, 0, 1]}},
        "wrenches": {"left": {"force": ["fx", 0, 0], "exerted_on": "object", "axes": "world"}},
        "grasps": [{"gripper": "left", "object": "door"}],
    }
    rows = [f"{0.1 * k:.2f},{0.01 * k:.3f},0,{0.02 * k:.3f},{0.01 * k - 0.5:.3f},{10 + 0.1 * k:.1f}" for k in range(12)]
    table = "\n".join(("t,x,y,yaw,gx,fx", *rows))
    return [{"map.yaml": yaml.safe_dump(mapping).encode(), "pull.csv": table.encode()}]


def mapped_bags() -> list[Files]:
    """Return a foreign bag with a mapping, and with the mapping that is proposed for it."""
    mapping = {
        "contract": True,
        "frames": {"lab": {"position": [1.0, 0.0, 0.0]}},
        "object_poses": {"table": {"topic": "/ar_tags/table/pose", "clock_offset": 0.1}},
        "wrenches": {"left": {"topic": "/wrist_ft/left", "sign": -1, "exerted_on": "gripper"}},
        "max_speed": 3.0,
    }
    return [{"map.yaml": yaml.safe_dump(mapping).encode(), **bags()["plain"][0]}]


def png(width: int, height: int, pixels: bytes) -> bytes:
    """Return a grey PNG that says it has a size, whatever it has."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    body = zlib.compress(pixels)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def maps() -> list[Files]:
    """Return maps with a PNG or a PGM, and some whose images claim to be huge."""
    said = {"image": "map.png", "resolution": 0.05, "origin": [-1.0, -1.0, 0.0], "negate": 0}
    said |= {"occupied_thresh": 0.65, "free_thresh": 0.196, "mode": "trinary"}
    rows = (b"\0" + bytes([254, 254, 0, 205] * 5)) * 20
    text = yaml.safe_dump(said).encode()
    pgm = yaml.safe_dump({**said, "image": "map.pgm", "mode": "scale"}).encode()
    grey = b"P5\n# made\n20 20\n255\n" + bytes([254, 0, 205, 100] * 100)
    huge = [{"map.yaml": text, "map.png": png(side, side, rows)} for side in (30_000, 100_000, 2**31 - 1)]
    claims = [b"P5\n999999999 999999999\n255\n" + bytes(100), b"P5 20000 20000 65535 " + bytes(100)]
    return [
        *({"map.yaml": text, "map.png": png(20, 20, rows)}, {"map.yaml": pgm, "map.pgm": grey}),
        *({"map.yaml": pgm, "map.pgm": b"P2\n4 4\n9\n" + b"0 9 3 4 " * 4}, *huge),
        *({"map.yaml": pgm, "map.pgm": each} for each in claims),
    ]


RECTANGLE = ((-0.6, -0.35), (0.6, -0.35), (0.6, 0.35), (-0.6, 0.35))
TRUE = {
    "mass": ("kg", 21.0, True),
    "wheel_x": ("m", -0.5, False),
    "wheel_y": ("m", 0.28, False),
    "wheel_theta": ("rad", 0.3, False),
    "mu_x": ("1", 0.03, True),
    "mu_y": ("1", 0.12, True),
}
TETHER = {
    "tether_stiffness": ("N/m", 40.0),
    "tether_x": ("m", 1.0),
    "tether_y": ("m", 0.5),
    "tether_length": ("m", 0.3),
}


@cache
def saved(*effects: str) -> SavedModel:
    """Return a learned model, with a cord if `effects` names it."""
    rng = np.random.default_rng(0)
    parameters = {
        name: learned(unit, value * (1.0 + 0.02 * rng.standard_normal(6)), value, positive=positive)
        for name, (unit, value, positive) in TRUE.items()
    }
    cord = {
        name: learned(unit, value * (1.0 + 0.01 * rng.standard_normal(6)), value)
        for name, (unit, value) in TETHER.items()
    }
    shape = Shape(footprint=RECTANGLE, feet=RECTANGLE, com=(0.0, 0.0), inertia_per_mass=0.17, nominal_mass=20.0)
    added = tuple(LearnedEffect(effect=name, parameters=cord) for name in effects)
    return SavedModel(object="table", shape=shape, parameters=parameters, effects=added, clock=(0.0, 9.0))


def models() -> list[Files]:
    """Return learned models as JSON."""
    return [{"model_table.json": saved(*each).model_dump_json().encode()} for each in ((), ("tether",))]


def posteriors() -> list[Files]:
    """Return a posterior as netCDF."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "posterior.nc"
        save_posterior(posterior_of(saved()), path)
        return [{"posterior_table.nc": path.read_bytes()}]


def reports() -> list[Files]:
    """Return `report.json` of a diagnosis with `residual.json` beside it."""
    effect = {
        "effect": "floor_patch",
        "probability": 0.97,
        "parameters": {"patch_mu": {"mean": 0.3, "sd": 0.02, "unit": "1"}},
        "where": {"frame": "world", "shape": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], "uncertainty": [[0.0, 0.0]]},
        "when": [[0.5, 1.5]],
        "direction": None,
    }
    found = {"mismatch": True, "p_value": 0.01, "effects": [effect], "alternatives": [], "unknown": False}
    wrench = {"time": [0.0, 0.5, 1.0], "wrench": [[1.0, 0.0, 0.1]] * 3, "sd": [[0.1, 0.1, 0.1]] * 3}
    report = {"recording": "bag", "objects": {"table": found}, "next_experiment": None, "seconds": 1.0}
    residual = {"objects": {"table": wrench}}
    return [{"report.json": json.dumps(report).encode(), "residual.json": json.dumps(residual).encode()}]


def primitives() -> list[Files]:
    """Return a short `.mprim`, cut from a real one, and one with an articulation."""
    whole = (workspace() / "test/data/lattice/pr2.mprim").read_text()
    head, *blocks = whole.split("primID:")
    few = head.replace(head.split("totalnumberofprimitives:")[1].split()[0], "3") + "primID:".join(["", *blocks[:3]])
    articulated = (
        "resolution_m: 0.1\nnumberofangles: 8\nnumberofarticulations: 2\narticulations_rad: 0.0 0.5\n"
        "totalnumberofprimitives: 1\nprimID: 0\nstartangle_c: 0\nstartarticulation_c: 0\nendpose_c: 1 0 0 0\n"
        "additionalactioncostmult: 1\nintermediateposes: 3\n0 0 0 0\n0.05 0 0 0\n0.1 0 0 0\n"
    )
    return [{"a.mprim": few.encode()}, {"a.mprim": articulated.encode()}]


def environments() -> list[Files]:
    """Return a small `.cfg`."""
    text = (
        "discretization(cells): 6 4\nobsthresh: 254\ncost_inscribed_thresh: 253\n"
        "cost_possibly_circumscribed_thresh: 128\ncellsize(meters): 0.1\nnominalvel(mpersecs): 1.0\n"
        "timetoturn45degsinplace(secs): 2.0\nstart(meters,rads): 0.1 0.1 0\nend(meters,rads): 0.3 0.3 0\nenvironment:\n"
    ) + "0 0 10 254 0 1\n" * 4
    return [{"a.cfg": text.encode()}]


def offices() -> list[Files]:
    """Return offices without the map of a whole floor."""
    found = config("offices", "x.yaml")
    people = {"people": {"ann": {"route": [[0.5, 0.5], [1.5, 0.5]]}}, "goals": {"door": [1.0, 1.0, 0.0]}}
    plain = yaml_of(found[0]["x.yaml"])
    return [{"x.yaml": yaml.safe_dump(each, sort_keys=False).encode()} for each in (plain, {**plain, **people})]


def domains() -> list[Files]:
    """Return the agents' domains."""
    return [
        *config_file("experiments/shopping_cart.yaml", "x.yaml"),
        *config_file("experiments/apartment.yaml", "x.yaml"),
    ]


def description(name: str) -> bytes:
    """Return a robot's URDF."""
    return (Path(get_package_share_directory("pbrl_description")) / name).read_bytes()
