"""The target of a sweep's files: a folder, or a URL that fsspec reaches, such as one of an object store."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from typing import Any, Optional, Union


class Target:
    """A folder, or the URL of one. A file is written whole or not at all: renamed in a folder, put as one object in an object store."""

    def __init__(self, place: Union[str, os.PathLike[str]], options: Optional[Mapping[str, Any]] = None) -> None:
        self.place = os.fspath(place)
        self.options = dict(options or {})
        if self.place.startswith("file://"):
            self.place = self.place[len("file://") :]

    @property
    def is_local(self) -> bool:
        """Whether the target is a folder of this machine."""
        return "://" not in self.place

    def path(self, name: str) -> str:
        """The path or URL of a file of the target."""
        return os.path.join(self.place, name) if self.is_local else f"{self.place.rstrip('/')}/{name}"

    def write(self, name: str, data: bytes) -> None:
        """Writes a file. Raises OSError where that fails; an earlier file of that name then remains unchanged."""
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
        """The content of a file, None where there is no such file. Raises OSError where it cannot be read."""
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


# The mask of a new file's permissions. `mkstemp` makes files that other users cannot read.
_UMASK = _umask()
