"""A learned object in other forms: read back by who reads them, with the numbers that were learned."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pybullet
import pytest
from jsonschema import Draft202012Validator

from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.export.mesh import mesh_text
from pbrl_bringup.export.rigid import RigidBody, rigid_body
from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.arviz_import import az
from pbrl_model.errors import ModelError
from pbrl_model.model_file import LearnedEffect, SavedModel, Shape, learned, load_model, save_model
from pbrl_model.model_schema import generated, schema_path

RECTANGLE = ((-0.6, -0.35), (0.6, -0.35), (0.6, 0.35), (-0.6, 0.35))
CORNER = ((0.0, 0.0), (1.2, 0.0), (1.2, 0.4), (0.5, 0.4), (0.5, 1.0), (0.0, 1.0))
RNG = np.random.default_rng(5)
UNITS = {"mass": "kg", "inertia_factor": "1", "com_x": "m", "wheel_x": "m", "wheel_y": "m", "wheel_theta": "rad"}
TRUE = {"mass": 21.0, "inertia_factor": 1.1, "com_x": 0.05, "wheel_x": -0.5, "wheel_y": 0.28, "wheel_theta": 0.3,
        "mu_x": 0.03, "mu_y": 0.12, "mu_ground": 0.02}  # fmt: skip


def made(*names: str, footprint: tuple[tuple[float, float], ...] = RECTANGLE, **more: object) -> SavedModel:
    chosen = names or tuple(TRUE)
    values = {"hinge_x": 1.0, "hinge_y": 0.0, "hinge_radius": 0.3, **TRUE}
    parameters = {
        name: learned(UNITS.get(name, "m" if name.startswith("hinge") else "1"),
                      values[name] * (1.0 + 0.02 * RNG.standard_normal(50)), values[name])
        for name in chosen
    }  # fmt: skip
    xs, ys = np.array(footprint).T
    shape = Shape(
        footprint=footprint,
        feet=footprint,
        com=(float(xs.mean()), float(ys.mean())),
        inertia_per_mass=0.17,
        nominal_mass=20.0,
    )
    return SavedModel(object="table a--b", shape=shape, parameters=parameters, notes=("one -- note",), **more)  # type: ignore[arg-type]


@pytest.fixture
def tether() -> LearnedEffect:
    names = {"tether_stiffness": "N/m", "tether_x": "m", "tether_y": "m", "tether_length": "m"}
    return LearnedEffect(
        effect="tether", parameters={name: learned(unit, np.full(50, 1.0), 1.0) for name, unit in names.items()}
    )


def export(model: SavedModel, form: str, folder: Path, *more: str) -> Path:
    save_model(model, folder / "model_table.json")
    out = folder / "out" / f"table.{form}"
    assert run_arguments(["export", str(folder), "--format", form, "--out", str(out), *more]) == 0
    return out


@pytest.mark.parametrize("footprint", [RECTANGLE, CORNER])
def test_a_urdf_has_the_learned_inertia(footprint: tuple[tuple[float, float], ...], tmp_path: Path) -> None:
    model = made(footprint=footprint)
    path = export(model, "urdf", tmp_path)
    built = pinocchio.buildModelFromXML(path.read_text())
    assert built.njoints == 1  # nothing moves in it
    body = rigid_body(model, 0.75)
    root = pinocchio.buildModelFromXML(path.read_text(), pinocchio.JointModelFreeFlyer()).inertias[1]
    assert root.mass == pytest.approx(model.parameters["mass"].mean, rel=1e-5)
    np.testing.assert_allclose(root.lever, body.com, atol=1e-5)
    np.testing.assert_allclose(root.inertia[2, 2], body.inertia[2], rtol=1e-4)
    factor = model.parameters["inertia_factor"].mean
    assert body.inertia[2] == pytest.approx(root.mass * factor * 0.17, rel=1e-4)
    assert np.linalg.eigvalsh(root.inertia).min() > 0.0
    assert body.inertia[2] < body.inertia[0] + body.inertia[1]


def settled(client: int, number: int) -> tuple[float, ...]:
    pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
    floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0.0, floor, physicsClientId=client)
    for _ in range(240):
        pybullet.stepSimulation(physicsClientId=client)
    return tuple(pybullet.getBasePositionAndOrientation(number, physicsClientId=client)[0])


@pytest.mark.parametrize("form", ["urdf", "sdf"])
def test_bullet_loads_it_and_it_stands_on_its_feet(form: str, tmp_path: Path) -> None:
    model = made()
    path = export(model, form, tmp_path)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        if form == "urdf":
            number = pybullet.loadURDF(str(path), physicsClientId=client)
        else:
            (number,) = pybullet.loadSDF(str(path), physicsClientId=client)
        mass = pybullet.getDynamicsInfo(number, -1, physicsClientId=client)[0]
        assert mass == pytest.approx(model.parameters["mass"].mean, rel=1e-4)
        before = pybullet.getBasePositionAndOrientation(number, physicsClientId=client)[0]
        after = settled(client, number)
        assert math.dist(before, after) < 5e-3
    finally:
        pybullet.disconnect(client)


def test_an_sdf_has_what_its_standard_asks_for(tmp_path: Path) -> None:
    model = made()
    path = export(model, "sdf", tmp_path, "--height", "0.5")
    root = ElementTree.parse(path).getroot()
    assert root.tag == "sdf" and root.get("version") == "1.9"
    (link,) = root.findall("model/link")
    assert link.findtext("inertial/mass") and len(link.findall("inertial/inertia/*")) == 6
    names = [part.get("name") for part in link.findall("collision")]
    assert len(set(names)) == len(names) == 6 and "wheel" in names  # outline, four feet, wheel
    contacts = {part.get("name"): part for part in link.findall("collision") if part.find("surface") is not None}
    for part in link.findall("*"):
        assert part.tag in {"inertial", "collision", "visual"}
        assert part.tag == "inertial" or part.find("geometry") is not None
    wheel = contacts["wheel"]
    mu = [float(wheel.findtext(f"surface/friction/ode/{name}") or "nan") for name in ("mu", "mu2")]
    means = {name: each.mean for name, each in model.parameters.items()}
    np.testing.assert_allclose(mu, [5 * means["mu_x"], 5 * means["mu_y"]], rtol=1e-6)
    along = np.array((wheel.findtext("surface/friction/ode/fdir1") or "").split(), dtype=float)
    assert math.atan2(along[1], along[0]) == pytest.approx(means["wheel_theta"], abs=1e-3)
    # The load shared alike, all feet together hold as much as the whole body was learned to.
    feet = [
        float(part.findtext("surface/friction/ode/mu") or "nan") for name, part in contacts.items() if name != "wheel"
    ]
    assert sum(feet) / 5.0 == pytest.approx(means["mu_ground"], rel=1e-6)


@pytest.mark.parametrize("form", ["urdf", "sdf"])
def test_how_sure_it_is_and_what_is_missing_stands_in_a_comment(
    form: str, tether: LearnedEffect, tmp_path: Path
) -> None:
    model = made(effects=(tether,))
    text = export(model, form, tmp_path).read_text()
    mass = model.parameters["mass"]
    assert f"mass = {mass.mean:.6g} +/- {mass.sd:.3g} kg" in text
    assert "tether" in text and "not learned" in text and "one - - note" in text
    assert "table_a__b" in text


def test_the_mesh_is_closed_and_as_large_as_the_outline() -> None:
    body: RigidBody = rigid_body(made(footprint=CORNER), 0.5)
    lines = mesh_text(body).splitlines()
    corners = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    faces = np.array([line.split()[1:] for line in lines if line.startswith("f ")], dtype=int) - 1
    a, b, c = (corners[faces[:, k]] for k in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
    area = 1.2 * 0.4 + 0.5 * 0.6
    assert volume == pytest.approx(area * (0.5 - 0.02), rel=1e-9)
    edges = sorted(map(tuple, np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()))
    assert edges == sorted((j, i) for i, j in edges)  # each edge once in each direction


def test_json_fits_the_schema_that_is_installed(tether: LearnedEffect, tmp_path: Path) -> None:
    path = export(made(effects=(tether,)), "json", tmp_path)
    schema = json.loads((path.parent / "model.schema.json").read_text())
    assert schema == json.loads(schema_path().read_text()) == generated(), "run python -m pbrl_model.model_schema"
    Draft202012Validator.check_schema(schema)
    checker, data = Draft202012Validator(schema), json.loads(path.read_text())
    assert list(checker.iter_errors(data)) == [] and load_model(path).names == ("tether",)
    data["parameters"]["mass"]["mean"] = "heavy"
    assert [list(error.path) for error in checker.iter_errors(data)] == [["parameters", "mass", "mean"]]
    assert not checker.is_valid({**data, "colour": "red"})


def test_netcdf_is_a_posterior_for_arviz(tether: LearnedEffect, tmp_path: Path) -> None:
    model = made()
    found = load_posterior(export(model, "netcdf", tmp_path))
    assert found.model_class == "wheel+ground"
    np.testing.assert_allclose(found.column("mass").ravel(), model.parameters["mass"].draws)
    path = export(made(effects=(tether,)), "netcdf", tmp_path)
    group = az().from_netcdf(str(path))["posterior"]
    assert group["tether_stiffness"].attrs["units"] == "N/m" and group["mass"].shape == (1, 50)
    with pytest.raises(ModelError, match="expected format"):
        load_posterior(path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere.json",), ("nowhere.json", "model")),
        ((".",), ("model_NAME.json",)),
        (("model_door.json", "--format", "sdf"), ("hinge", "netcdf")),
        (("model_door.json", "--format", "urdf", "--out", "file/below.urdf"), ("file/below.urdf",)),
        (("two",), ("--object",)),
        (("two", "--object", "c"), ("'c'", "a, b")),
    ],
)
def test_mistakes_are_one_line(
    arguments: tuple[str, ...],
    words: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    door = ("mass", "mu_x", "mu_y", "hinge_x", "hinge_y", "hinge_radius")
    save_model(made(*(door if "file/below.urdf" not in arguments else ())), tmp_path / "model_door.json")
    for name in ("a", "b"):
        save_model(made(), tmp_path / "two" / f"model_{name}.json")
    if arguments == (".",):
        (tmp_path / "model_door.json").unlink()
    assert run_arguments(["export", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert all(word in line for word in words)
