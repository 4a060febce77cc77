"""A sweep in shards: their computation on an executor, and their files.

The rows of a shard do not depend on the process that computes it, so that a lost shard can be computed again in another.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _hapt
from ._target import Target

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow.dataset

#: The name of the manifest, which identifies the sweep and lists the finished shards.
MANIFEST = "_manifest.json"
#: The intended computing time of a shard in s: long against its overhead.
SHARD = 1.0
#: The largest number of rows of a shard, and of those in memory at once.
MAX_ROWS, GROUP = 1 << 24, 1 << 16
#: The largest number of shards submitted at once, and the least time in s between two writes of the manifest.
UNDER_WAY, NOTED = 1000, 1.0


@dataclass(frozen=True)
class Job:
    """A sweep as plain data that can be sent to a worker."""

    parts: tuple[Any, ...]
    axes: dict[str, NDArray[np.float64]]
    measures: list[str]
    scenario: Optional[str]
    version: str = _hapt.VERSION

    def grid(self) -> _hapt.Sweep:
        """Reads the world and makes the grid. Raises the errors of `World.sweep`."""
        return _hapt.read(*self.parts).sweep(list(self.axes.items()), self.measures, self.scenario)

    def fingerprint(self, grid: _hapt.Sweep) -> str:
        """A hash of everything that the rows depend on, with the contents on this machine of the files that the world names."""
        return hashlib.sha256(f"{self.version} {grid.content()}".encode()).hexdigest()

    def columns(self, start: int, rows: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """The table's columns for the cells from `start` on: the keys' values, then the measures `rows`, shape (cells, measures)."""
        places = np.unravel_index(np.arange(start, start + len(rows)), [len(values) for values in self.axes.values()])
        keys = {key: values[place] for (key, values), place in zip(self.axes.items(), places)}
        return {**keys, **{name: rows[:, i] for i, name in enumerate(self.measures)}}


def compute(job: Job, fingerprint: str, start: int, end: int, threads: int, target: Optional[Target], name: str) -> Any:
    """Computes the cells from `start` up to `end`. Without a target it returns the measures, shape (cells, measures).

    With a target it writes the rows as a Parquet file `name` there, and returns None. Raises RuntimeError where this worker has another
    version of hapt, or another content of a file that the world names.
    """
    if job.version != _hapt.VERSION:
        raise RuntimeError(f"this worker has hapt {_hapt.VERSION}, and the sweep is one of hapt {job.version}")
    grid, width = job.grid(), len(job.measures)
    if job.fingerprint(grid) != fingerprint:
        raise RuntimeError("this worker reads another world: a file that the world names (a path, a texture) has another content here")
    stretches = ((first, min(first + GROUP, end)) for first in range(start, end, GROUP))
    rows = ((first, grid.rows(first, last, threads).reshape(-1, width)) for first, last in stretches)
    if target is None:
        return np.concatenate([np.empty((0, width)), *(part for _, part in rows)])
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([pa.field(column, pa.float64()) for column in [*job.axes, *job.measures]])
    data = io.BytesIO()
    with pq.ParquetWriter(data, schema) as writer:
        for first, part in rows:
            writer.write_table(pa.table([pa.array(c, from_pandas=True) for c in job.columns(first, part).values()], schema=schema))
    target.write(name, data.getvalue())
    return None


def executor_of(client: Any) -> Executor:
    """`client` as an executor. Raises TypeError for a type that `World.sweep` does not name."""
    if isinstance(client, Executor):
        return client
    if hasattr(client, "get_executor"):  # Dask's client, which runs a lost worker's tasks on other workers.
        return client.get_executor(retries=3, pure=False)  # type: ignore[no-any-return]
    if hasattr(client, "ObjectRef"):  # The module ray.
        return _Ray(client)
    raise TypeError(f"client is a concurrent.futures.Executor, a Dask client or the module ray, not {type(client).__name__}")


class _Ray(Executor):
    def __init__(self, ray: Any) -> None:
        self._ray = ray

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        return self._ray.remote(function).remote(*arguments, **named).future()  # type: ignore[no-any-return]


def shards_of(cells: int, grid: _hapt.Sweep, threads: int) -> int:
    """The number of shards with which each takes about `SHARD` seconds of this process."""
    count, spent = 16, 0.0
    while count < min(cells, GROUP) and spent < SHARD / 10:
        count = min(4 * count, cells, GROUP)
        began = time.perf_counter()
        grid.rows(0, count, threads)
        spent = time.perf_counter() - began
    most = min(MAX_ROWS, int(SHARD * count / max(spent, 1e-9)))
    return max(-(-cells // max(most, 1)), 1)


def ends(cells: int, shards: int, shard: int) -> tuple[int, int]:
    """The first cell of a shard and the one after its last, as `hapt sweep --shard` divides the table."""
    return shard * cells // shards, (shard + 1) * cells // shards


def run(
    job: Job, fingerprint: str, todo: list[int], cells: int, shards: int, client: Any, threads: int, target: Optional[Target]
) -> Iterator[tuple[int, Any]]:
    """Computes the shards `todo`, and yields `(shard, result)` in the order in which they finish.

    A lost worker's shards are computed again: on another worker of the executor, or in this process where the executor is broken. Where a
    shard raises an exception, the other shards are cancelled and the exception is raised.
    """
    executor = None if client is None else executor_of(client)
    left, pending = iter(todo), dict[Any, int]()
    done = set[int]()
    try:
        while executor is not None and len(done) < len(todo):
            for shard in left:
                start, end = ends(cells, shards, shard)
                pending[executor.submit(compute, job, fingerprint, start, end, threads, target, file_of(shard))] = shard
                if len(pending) >= UNDER_WAY:
                    break
            # Short waits, because Ctrl-C does not end one on every system.
            for future in wait(pending, timeout=0.1, return_when=FIRST_COMPLETED).done:
                shard = pending.pop(future)
                result = future.result()
                done.add(shard)
                yield shard, result
    except BrokenExecutor as error:
        warnings.warn(f"the executor is broken ({error}): the missing shards are computed in this process", RuntimeWarning, stacklevel=3)
    except CancelledError as error:
        raise RuntimeError("the executor has cancelled its shards: its scheduler is gone") from error
    finally:
        for future in pending:
            future.cancel()
    for shard in todo:
        if shard not in done:
            start, end = ends(cells, shards, shard)
            yield shard, compute(job, fingerprint, start, end, 0, target, file_of(shard))


def file_of(shard: int) -> str:
    """The name of a shard's file. The names sort in the order of the table."""
    return f"part-{shard:08}.parquet"


class Dataset:
    """A sweep's table as Parquet files, one for each shard, in the order of the table. A measure without a value is null.

    `place` is the folder or URL, `files` are the files' paths or URLs, `cells` is the number of rows. These read it:
    `pandas.read_parquet(place)`, `polars.scan_parquet(glob)`, DuckDB's `FROM 'glob'` and `scan()`; the last three read lazily.
    """

    def __init__(self, target: Target, cells: int, shards: int) -> None:
        self._target = target
        self.place = target.place
        self.cells = cells
        self.files = [target.path(file_of(shard)) for shard in range(shards)]

    def __repr__(self) -> str:
        return f"<hapt.Dataset {self.place}: {self.cells} rows in {len(self.files)} files>"

    @property
    def glob(self) -> str:
        """A pattern that matches all files."""
        return self._target.path("part-*.parquet")

    def scan(self) -> pyarrow.dataset.Dataset:
        """The table as a pyarrow data set, which reads only the columns and rows of a query."""
        import pyarrow.dataset as ds

        if self._target.is_local:
            return ds.dataset(self.files, format="parquet")
        from fsspec.core import url_to_fs

        system, _ = url_to_fs(self.place, **self._target.options)
        return ds.dataset([system._strip_protocol(file) for file in self.files], filesystem=system, format="parquet")

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame of all rows, in memory."""
        return self.scan().to_table().to_pandas()  # type: ignore[no-any-return]


class Manifest:
    """The manifest of a target: the sweep's fingerprint, the number of shards, and the finished shards."""

    def __init__(self, target: Target, fields: dict[str, Any]) -> None:
        self._target = target
        self._fields = fields
        self._noted = 0.0

    @classmethod
    def open(cls, target: Target, fingerprint: str, cells: int, shards: Optional[int], default: Callable[[], int]) -> Manifest:
        """Reads the target's manifest, or writes a new one.

        Raises ValueError for the manifest of another sweep or another number of shards, OSError where it cannot be read or written.
        """
        text = target.read(MANIFEST)
        if text is None:
            count = shards or default()
            fields = {"hapt": _hapt.VERSION, "fingerprint": fingerprint, "cells": cells, "shards": count, "done": []}
            made = cls(target, fields)
            made.write()
            return made
        try:
            fields = json.loads(text)
            known, count = fields["fingerprint"], int(fields["shards"])
            fields["done"] = [int(shard) for shard in fields["done"]]
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{target.path(MANIFEST)} is no manifest of a sweep: choose another target, or remove it") from None
        if known != fingerprint:
            raise ValueError(f"{target.place} holds another sweep, or one of another version of hapt: choose another target, or remove it")
        if shards not in (None, count):
            raise ValueError(f"{target.place} holds this sweep in {count} shards, not {shards}: leave shards out, or choose another target")
        return cls(target, fields)

    @property
    def shards(self) -> int:
        """The number of shards."""
        return int(self._fields["shards"])

    @property
    def missing(self) -> list[int]:
        """The shards that are not finished."""
        done = set(self._fields["done"])
        return [shard for shard in range(self.shards) if shard not in done]

    def note(self, shard: int) -> None:
        """Records a finished shard, and writes the manifest at most every `NOTED` seconds.

        A shard that is finished but not recorded is computed again, with the same bytes.
        """
        self._fields["done"].append(shard)
        if time.monotonic() - self._noted > NOTED:
            self.write()

    def write(self) -> None:
        """Writes the manifest, whole or not at all."""
        self._fields["done"].sort()
        self._target.write(MANIFEST, json.dumps(self._fields).encode())
        self._noted = time.monotonic()
