"""The program hapt, for the commands that the package does not contain."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from typing import Optional


def found(program: Optional[str]) -> str:
    """The path of the program: `program`, or hapt found on the path. Raises FileNotFoundError where there is none."""
    path = program or shutil.which("hapt")
    if path is None:
        raise FileNotFoundError("the program hapt is not on the path: cargo install --path crates/hapt, or name it as program=")
    return path


def ran(program: Optional[str], words: Sequence[str], world: str) -> None:
    """Runs a command on a world's text. Raises ValueError for bad input, OSError for another failure, with the command's message."""
    ended = subprocess.run([found(program), *words], input=world, capture_output=True, text=True)
    if ended.returncode:
        message = ended.stderr.strip() or f"hapt ends with exit code {ended.returncode}"
        raise ValueError(message) if ended.returncode == 2 else OSError(message)
