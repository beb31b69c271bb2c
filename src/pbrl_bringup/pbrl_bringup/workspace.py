"""Make the environment that `./pbrl` runs in: virtual environment, ROS 2, colcon build.

Run by the root script on first use and after a change of requirements, messages or packages, with
the machine's own Python: standard library only. Where a ROS 2 Jazzy is sourced it is used; elsewhere
ROS 2 comes from wheels, which need one repair before they can build packages (`repair_wheels`).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

WHEEL_PYTHON = "/opt/python/cp311-cp311"  # where the wheels were built; stands in their CMake files
UNDERLAY = {
    # A message of a package that has no wheel, needed on the wire: name -> (file, text, dependencies).
    "tf2_msgs": ("msg/TFMessage.msg", "geometry_msgs/TransformStamped[] transforms\n", ("geometry_msgs",)),
}
ENVIRONMENT = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


class SetupError(Exception):
    """Something is missing; the message is one line and says what to do."""


def main(root: Path) -> None:
    """Make or mend `.venv`, `underlay/` and `install/` below `root`, and write `.venv/pbrl.env`."""
    ros = sourced_ros()
    require_tools(ros is not None)
    venv = root / ".venv"
    started = time.monotonic()
    with Step(1, "virtual environment"):
        if not (venv / "bin/python").exists():
            site = ["--system-site-packages"] if ros else []
            run([sys.executable, "-m", "venv", *site, str(venv)], root)
    with Step(2, "packages" if ros else "packages, ROS 2 Jazzy among them"):
        install_requirements(root, venv, wheels=ros is None)
    env = build_environment(venv, ros)
    with Step(3, "message packages that are not installed"):
        if ros is None:
            repair_wheels(venv)
        underlay = build_underlay(root, env)
    with Step(4, "the workspace"):
        colcon(root, root, env, underlay)
    write_environment(root, env, underlay)
    print(f"pbrl: ready after {time.monotonic() - started:.0f} s", file=sys.stderr)


class Step:
    """One line of progress: what is being done, and how long it took."""

    def __init__(self, number: int, what: str) -> None:
        self.text = f"pbrl: [{number}/4] {what}"

    def __enter__(self) -> None:
        self.started = time.monotonic()
        print(f"{self.text} ...", end="", file=sys.stderr, flush=True)

    def __exit__(self, kind: object, *_: object) -> None:
        outcome = "failed" if kind else f"{time.monotonic() - self.started:.0f} s"
        print(f" {outcome}", file=sys.stderr, flush=True)


def sourced_ros() -> str | None:
    """Return the prefix path of a sourced ROS 2 Jazzy, or None; another distribution is an error."""
    distro = os.environ.get("ROS_DISTRO")
    if distro is None:
        return None
    if distro != "jazzy":
        raise SetupError(f"expected ROS 2 jazzy or none to be sourced, got {distro!r}; open a shell without it")
    prefix = os.environ.get("AMENT_PREFIX_PATH")
    if not prefix:
        raise SetupError("ROS_DISTRO is set but AMENT_PREFIX_PATH is not; source /opt/ros/jazzy/setup.bash again")
    return prefix


def require_tools(ros: bool) -> None:
    """Raise SetupError for a Python or a compiler that cannot do the work."""
    version = sys.version_info[:2]
    if not ros and version != (3, 11):
        raise SetupError(
            f"expected Python 3.11 (the ROS 2 wheels are made for it), got {version[0]}.{version[1]} at "
            f"{sys.executable}; put python3.11 on PATH or source a ROS 2 Jazzy"
        )
    if ros and version < (3, 11):
        raise SetupError(f"expected Python 3.11 or newer, got {version[0]}.{version[1]} at {sys.executable}")
    for tool, package in {"cc": "gcc", "c++": "g++", "make": "make", "cmake": "cmake"}.items():
        if shutil.which(tool) is None:
            raise SetupError(f"expected the program {tool!r} on PATH, found none; install the package {package}")
    header = Path(sysconfig.get_paths()["include"]) / "Python.h"
    if not header.exists():
        raise SetupError(f"expected Python's headers at {header}; install the package python3-dev")


def install_requirements(root: Path, venv: Path, *, wheels: bool) -> None:
    """Install the exact pins into `venv`."""
    files = ["base.txt", "build.txt", "ros-wheels.txt" if wheels else "ros-sourced.txt"]
    arguments = [part for name in files for part in ("-r", str(root / "requirements" / name))]
    # The constraints were resolved with Python 3.11; a sourced ROS brings its own Python and packages.
    constraints = ["-c", str(root / "requirements/constraints.txt")] if wheels else []
    pip = [str(venv / "bin/python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run([*pip, *constraints, *arguments], root)


def repair_wheels(venv: Path) -> None:
    """Put this machine's directories where the wheels' CMake files name those of their builder."""
    include = sysconfig.get_paths()["include"]
    site = str(site_packages(venv))
    for path in (venv / "share").rglob("*.cmake"):
        text = path.read_text(encoding="utf-8", errors="surrogateescape")
        if WHEEL_PYTHON in text:
            text = text.replace(f"{WHEEL_PYTHON}/include/python3.11", include)
            text = text.replace(f"{WHEEL_PYTHON}/lib/python3.11/site-packages", site)
            path.write_text(text, encoding="utf-8", errors="surrogateescape")


def site_packages(venv: Path) -> Path:
    """Return the site-packages directory of `venv`."""
    return next((venv / "lib").glob("python3.*")) / "site-packages"


def build_environment(venv: Path, ros: str | None) -> dict[str, str]:
    """Return the environment in which colcon builds and nodes run, workspace not yet included."""
    env = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME")}
    env["VIRTUAL_ENV"] = str(venv)
    env["PATH"] = f"{venv / 'bin'}:{env['PATH']}"
    if ros:
        env["PYTHONPATH"] = os.environ.get("PYTHONPATH", "")
        return env
    libraries = [venv / "lib", *site_packages(venv).glob("ros_*.libs")]
    inherited = env.get("LD_LIBRARY_PATH", "")
    env["LD_LIBRARY_PATH"] = ":".join([*map(str, libraries), *([inherited] if inherited else [])])
    env["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"  # spares every Python a second start
    env["AMENT_PREFIX_PATH"] = env["CMAKE_PREFIX_PATH"] = str(venv)
    return env


def build_underlay(root: Path, env: dict[str, str]) -> Path | None:
    """Build the interface packages of UNDERLAY that are not found; return their prefix, if any."""
    prefixes = [Path(prefix) for prefix in env["AMENT_PREFIX_PATH"].split(":")]
    index = "share/ament_index/resource_index/packages"
    missing = [name for name in UNDERLAY if not any((prefix / index / name).exists() for prefix in prefixes)]
    base = root / "underlay"
    if not missing:
        return None
    if not all((base / "install" / index / name).exists() for name in missing):
        for name in missing:
            write_interface_package(base / "src" / name, name)
        (base / "COLCON_IGNORE").touch()  # a plain `colcon build` in the root is to leave it alone
        colcon(root, base, env, None)
    return base / "install"


def write_interface_package(folder: Path, name: str) -> None:
    """Write an ament_cmake package that defines the one interface of UNDERLAY[name]."""
    file, text, depends = UNDERLAY[name]
    (folder / file).parent.mkdir(parents=True, exist_ok=True)
    (folder / file).write_text(text, encoding="utf-8")
    tags = "".join(f"<depend>{package}</depend>" for package in depends)
    (folder / "package.xml").write_text(
        f'<package format="3"><name>{name}</name><version>0.0.0</version><description>Interfaces of {name}.'
        '</description><maintainer email="pbrl@example.org">PBRL</maintainer><license>BSD-3-Clause</license>'
        f"<buildtool_depend>ament_cmake</buildtool_depend><build_depend>rosidl_default_generators</build_depend>{tags}"
        "<exec_depend>rosidl_default_runtime</exec_depend><member_of_group>rosidl_interface_packages"
        "</member_of_group><export><build_type>ament_cmake</build_type></export></package>\n",
        encoding="utf-8",
    )
    find = "\n".join(f"find_package({package} REQUIRED)" for package in depends)
    (folder / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.16)\nproject({name})\nfind_package(ament_cmake REQUIRED)\n"
        f"find_package(rosidl_default_generators REQUIRED)\n{find}\n"
        f"rosidl_generate_interfaces(${{PROJECT_NAME}} {file} DEPENDENCIES {' '.join(depends)})\nament_package()\n",
        encoding="utf-8",
    )


def colcon(root: Path, folder: Path, env: dict[str, str], underlay: Path | None) -> None:
    """Build the packages below `folder` into `folder/install`, on top of the environment."""
    if underlay:
        env = sourced(env, underlay)
    paths = ["--base-paths", *(["msg", "urdf", "config", "src"] if folder == root else ["src"])]
    layout = ["--merge-install", "--symlink-install"]
    command = ["python", "-m", "colcon", "--log-level", "error", "build", *layout, *paths]
    command += ["--event-handlers", "console_direct-", "console_cohesion-", "summary-", "status-"]
    # setup.py develop and easy_install are deprecated and say so; colcon still builds links with them.
    command += ["--cmake-args", "-DBUILD_TESTING=OFF", f"-DPython3_EXECUTABLE={env['VIRTUAL_ENV']}/bin/python"]
    run(command, folder, env | {"PYTHONWARNINGS": "ignore"}, log=folder / "log/latest_build")


def sourced(env: dict[str, str], prefix: Path) -> dict[str, str]:
    """Return the environment that sourcing a colcon prefix on top of `env` leaves."""
    script = f'. "{prefix}/local_setup.bash" && env -0'
    result = subprocess.run(["bash", "-c", script], env=env, stdout=subprocess.PIPE, text=True, check=True)
    return dict(line.split("=", 1) for line in result.stdout.split("\0") if "=" in line)


def write_environment(root: Path, env: dict[str, str], underlay: Path | None) -> None:
    """Write `.venv/pbrl.env`, which the root script sources: what setup.bash leaves, at no cost."""
    if underlay:
        env = sourced(env, underlay)
    env = sourced(env, root / "install")
    names = [*ENVIRONMENT, "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"]
    original = os.environ.get("PATH", "")
    lines = []
    for name in names:
        value = env.get(name)
        if value is None:
            continue
        # The caller's PATH may differ from the one at set-up: keep theirs, put ours in front.
        quoted = value.replace(original, "$PATH") if name == "PATH" else value
        lines.append(f'export {name}="{quoted}"')
    (root / ".venv/pbrl.env").write_text("\n".join(lines) + f'\nexport PBRL_ROOT="{root}"\n', encoding="utf-8")


def run(command: list[str], folder: Path, env: dict[str, str] | None = None, log: Path | None = None) -> None:
    """Run a command, quietly; raise SetupError with the end of its output where it fails."""
    result = subprocess.run(command, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if result.returncode:
        tail = "\n".join(result.stdout.splitlines()[-25:])
        where = f"; logs in {log}" if log else ""
        raise SetupError(f"{' '.join(command[:5])} ... ended with exit code {result.returncode}{where}\n{tail}")


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]).resolve())
    except SetupError as error:
        sys.exit(f"\npbrl: {error}")
