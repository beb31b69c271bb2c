"""Settings and plans of the installed workspace, by name."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from pbrl_control.errors import ControlError
from pbrl_control.settings import Model, load_section


def params_folder(what: str) -> Path:
    """Return `config/params/` as installed.

    Args:
        what: is looked for, for the error.

    Raises:
        ControlError: the workspace is not installed.
    """
    try:
        return Path(get_package_share_directory("pbrl_config")) / "params"
    except PackageNotFoundError as error:
        raise ControlError(f"{what}: expected package pbrl_config to be installed; run ./pbrl once") from error


def load_named(name_or_path: str | Path, kind: str, model: type[Model], what: str) -> Model:
    """Read a YAML file: a path, or the name of a file in a folder of `config/params/`.

    Args:
        name_or_path: which.
        kind: the folder.
        model: what the file holds.
        what: it is called in errors.

    Raises:
        ControlError: there is no such file, or it is not as it should be.
    """
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = params_folder(what) / kind / f"{name_or_path}.yaml"
        if not path.exists():
            known = ", ".join(sorted(file.stem for file in path.parent.glob("*.yaml"))) or "none"
            raise ControlError(f"{what}: expected a path or one of {known}, got {str(name_or_path)!r}")
    return load_section(path, model, what)
