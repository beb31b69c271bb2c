"""Programs that come from Debian packages: found, or installed where this user may, or named."""

from __future__ import annotations

import os
import shutil
import subprocess

from pbrl_bringup.errors import BringupError


def ensure_program(program: str, package: str, purpose: str) -> str:
    """Return the path of `program`; install `package` first where it is missing and apt-get may be used.

    Args:
        program: executable looked for on PATH.
        package: Debian package that brings it.
        purpose: what needs it, for the error.

    Raises:
        BringupError: the program is missing and could not be installed; says what to type.
    """
    found = shutil.which(program)
    if found is None and os.geteuid() == 0 and shutil.which("apt-get"):
        env = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        for arguments in (["update", "-qq"], ["install", "-qq", "--yes", "--no-install-recommends", package]):
            subprocess.run(["apt-get", *arguments], env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        found = shutil.which(program)
    if found is None:
        raise BringupError(
            f"expected the program {program!r} on PATH ({purpose} needs it), found none; "
            f"install it: sudo apt-get install {package}"
        )
    return found
