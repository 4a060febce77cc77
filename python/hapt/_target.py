"""Where a sweep's files go: a folder, or a URL that fsspec reaches, object stores included."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from typing import Any, Optional, Union


class Target:
    """A folder or the URL of one. A file is there whole or not at all: renamed into a folder, put into an object store."""

    def __init__(self, place: Union[str, os.PathLike[str]], options: Optional[Mapping[str, Any]] = None) -> None:
        self.place = os.fspath(place)
        self.options = dict(options or {})
        if self.place.startswith("file://"):
            self.place = self.place[len("file://") :]

    @property
    def is_local(self) -> bool:
        """Whether it is a folder of this machine."""
        return "://" not in self.place

    def path(self, name: str) -> str:
        """A file's path or URL."""
        return os.path.join(self.place, name) if self.is_local else f"{self.place.rstrip('/')}/{name}"

    def write(self, name: str, data: bytes) -> None:
        """Writes a file. Raises OSError where that fails; a file of that name is then as it was."""
        if not self.is_local:
            system, path = self._system(name)
            system.pipe_file(path, data)
            return
        os.makedirs(self.place, exist_ok=True)
        number, draft = tempfile.mkstemp(prefix=f".{name}.", dir=self.place)
        try:
            with os.fdopen(number, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(draft, 0o666 & ~_UMASK)
            os.replace(draft, self.path(name))
        except BaseException:
            os.unlink(draft)
            raise

    def read(self, name: str) -> Optional[bytes]:
        """A file's content; None where there is no such file. Raises OSError."""
        try:
            if self.is_local:
                with open(self.path(name), "rb") as file:
                    return file.read()
            system, path = self._system(name)
            system.invalidate_cache()
            return bytes(system.cat_file(path))
        except FileNotFoundError:
            return None

    def _system(self, name: str) -> Any:
        from fsspec.core import url_to_fs

        return url_to_fs(self.path(name), **self.options)


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


# What a file's permissions leave out: `mkstemp` makes one that no other user can read.
_UMASK = _umask()
