"""`./pbrl export MODEL`: a learned object for other stacks, as URDF, SDF, JSON with its schema, or ArviZ netCDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pbrl_bringup.errors import BringupError
from pbrl_bringup.export.mesh import mesh_text
from pbrl_bringup.export.rigid import rigid_body
from pbrl_bringup.export.sdf import sdf_text
from pbrl_bringup.export.urdf import urdf_text
from pbrl_bringup.files import write_text
from pbrl_bringup.terminal import output, styled
from pbrl_model.arviz_bridge import save_model_draws
from pbrl_model.model_file import SavedModel, load_model, save_model
from pbrl_model.model_schema import SCHEMA, schema_text


def command(model: Path, form: str, out: Path | None, height: float, only: str | None) -> int:
    """Write one learned object in another form.

    Args:
        model: file `model_NAME.json`, or the folder of a fit or a diagnosis that holds some.
        form: "urdf", "sdf", "json" or "netcdf".
        out: file to write; None: OBJECT.SUFFIX here.
        height: of the body [m].
        only: which object of a folder; None: the only one.

    Raises:
        ModelError: the model cannot be read, or nothing can be written there.
        BringupError: a folder has no model or several, or the form has no word for the model.
    """
    found = load_model(_file(model, only))
    suffix = {"netcdf": "nc"}.get(form, form)
    path = out or Path(f"{found.object}.{suffix}")
    written = _write(found, form, path, height)
    for each in written:
        output().print(styled(str(each), "bold"))
    return 0


def _write(model: SavedModel, form: str, path: Path, height: float) -> Sequence[Path]:
    """Write the files of a form and return their paths, the chief one first."""
    if form == "netcdf":
        save_model_draws(model, path)
        return (path,)
    if form == "json":
        schema = path.with_name(SCHEMA)
        save_model(model, path)
        write_text(schema, schema_text())
        return (path, schema)
    body = rigid_body(model, height)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BringupError(f"{path}: cannot be written: {error.strerror}; choose another --out") from error
    mesh, text = path.with_suffix(".obj"), sdf_text if form == "sdf" else urdf_text
    write_text(mesh, mesh_text(body))
    write_text(path, text(body, mesh.name))
    return (path, mesh)


def _file(path: Path, only: str | None) -> Path:
    """Return the model's file that is meant."""
    if not path.is_dir():
        return path
    there = {each.stem.removeprefix("model_"): each for each in sorted(path.glob("model_*.json"))}
    if not there:
        raise BringupError(f"{path}: expected model_NAME.json in it, as fit and diagnose write, got none")
    if only is None and len(there) > 1:
        raise BringupError(f"{path}: expected one model, got {', '.join(there)}; choose with --object")
    name = only or next(iter(there))
    if name not in there:
        raise BringupError(f"{path}: expected one of {', '.join(there)}, got {name!r}")
    return there[name]
