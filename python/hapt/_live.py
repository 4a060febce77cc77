"""`hapt live` as a process, started from Python."""

from __future__ import annotations

import os
import subprocess
import tempfile
from typing import Any, Optional

from ._program import found


class Live:
    """A running `hapt live`; `address` is the URL of its page. It ends with `close()`, at the end of a `with` block, or with Python.

    Raises FileNotFoundError without the program, RuntimeError where it ends before it serves a page.
    """

    def __init__(self, world: str, port: int = 0, program: Optional[str] = None) -> None:
        path = found(program)
        file, self._file = tempfile.mkstemp(suffix=".toml")
        self._process: Optional[subprocess.Popen[str]] = None
        with os.fdopen(file, "w", encoding="utf-8") as out:
            out.write(world)
        command = [path, "live", self._file, "--port", str(int(port))]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().strip()
        if not self.address:
            code = self._process.wait()
            self.close()
            raise RuntimeError(f"hapt live ends with exit code {code} before it serves a page")

    def close(self) -> None:
        """Ends the loop and its page."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            if self._process.stdout is not None:
                self._process.stdout.close()
            self._process = None
        if os.path.exists(self._file):
            os.unlink(self._file)

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if hasattr(self, "_file"):
            self.close()

    def __repr__(self) -> str:
        return f"<hapt.Live {self.address}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="640" style="border:0"></iframe>'
