"""A sweep beyond one process: shards on an executor, and their files.

The rows of a shard do not depend on where it is computed, so a shard can be computed again, anywhere, at any time.
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

#: The file that records of which sweep the others are, and which of them are there.
MANIFEST = "_manifest.json"
#: A shard shall take so long, in s, so that its overhead is small.
SHARD = 1.0
#: The most rows of a shard, and in memory at once.
MAX_ROWS, GROUP = 1 << 24, 1 << 16
#: Shards under way at once at most, and seconds between two writes of the manifest.
UNDER_WAY, NOTED = 1000, 1.0


@dataclass(frozen=True)
class Job:
    """A sweep as plain data: what a worker needs, and nothing else."""

    parts: tuple[Any, ...]
    axes: dict[str, NDArray[np.float64]]
    measures: list[str]
    scenario: Optional[str]
    version: str = _hapt.VERSION

    def grid(self) -> _hapt.Sweep:
        """The grid with all of the reader's checks."""
        return _hapt.read(*self.parts).sweep(list(self.axes.items()), self.measures, self.scenario)

    def fingerprint(self, grid: _hapt.Sweep) -> str:
        """Of everything that the rows depend on, the files that it names among it: they may differ from machine to machine."""
        return hashlib.sha256(f"{self.version} {grid.content()}".encode()).hexdigest()

    def columns(self, start: int, rows: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """The table's columns of the cells from `start` on, of which `rows` are the measures."""
        places = np.unravel_index(np.arange(start, start + len(rows)), [len(values) for values in self.axes.values()])
        keys = {key: values[place] for (key, values), place in zip(self.axes.items(), places)}
        return {**keys, **{name: rows[:, i] for i, name in enumerate(self.measures)}}


def compute(job: Job, fingerprint: str, start: int, end: int, threads: int, target: Optional[Target], name: str) -> Any:
    """A shard's measures, shape (cells, measures); with a target its rows as a Parquet file there, and None.

    Raises RuntimeError where this worker has another version, or another content of a file that the world names.
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
    """`client` as an executor. Raises TypeError for what is none of those that `World.sweep` names."""
    if isinstance(client, Executor):
        return client
    if hasattr(client, "get_executor"):  # Dask's client, which gives a lost worker's tasks to others.
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
    """So many shards that each takes about a second of a worker like this process."""
    count, spent = 16, 0.0
    while count < min(cells, GROUP) and spent < SHARD / 10:
        count = min(4 * count, cells, GROUP)
        began = time.perf_counter()
        grid.rows(0, count, threads)
        spent = time.perf_counter() - began
    most = min(MAX_ROWS, int(SHARD * count / max(spent, 1e-9)))
    return max(-(-cells // max(most, 1)), 1)


def ends(cells: int, shards: int, shard: int) -> tuple[int, int]:
    """The cells of a shard, as `hapt sweep --shard` has them."""
    return shard * cells // shards, (shard + 1) * cells // shards


def run(
    job: Job, fingerprint: str, todo: list[int], cells: int, shards: int, client: Any, threads: int, target: Optional[Target]
) -> Iterator[tuple[int, Any]]:
    """`(shard, result)` in the order in which they are done.

    A lost worker's shards run again: on another one where the executor has others, in this process where the executor is broken. Raises
    what a shard raises, after the shards under way are cancelled.
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
        warnings.warn(f"the executor is broken ({error}): the shards that are missing run in this process", RuntimeWarning, stacklevel=3)
    except CancelledError as error:
        raise RuntimeError("the executor has lost its shards: its scheduler is gone") from error
    finally:
        for future in pending:
            future.cancel()
    for shard in todo:
        if shard not in done:
            start, end = ends(cells, shards, shard)
            yield shard, compute(job, fingerprint, start, end, 0, target, file_of(shard))


def file_of(shard: int) -> str:
    """The name of a shard's file: in the order of the table."""
    return f"part-{shard:08}.parquet"


class Dataset:
    """A sweep's table as Parquet files, one a shard, in the order of the table; null where a measure has no value.

    `place` is the folder or URL, `files` are the files, `cells` is the number of rows. `pandas.read_parquet(place)`,
    `polars.scan_parquet(glob)`, DuckDB's `FROM 'glob'` and `scan()` read it; the last three lazily.
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
        """A pattern of all of its files."""
        return self._target.path("part-*.parquet")

    def scan(self) -> pyarrow.dataset.Dataset:
        """The data set of pyarrow, which reads the columns and rows that are asked for."""
        import pyarrow.dataset as ds

        if self._target.is_local:
            return ds.dataset(self.files, format="parquet")
        from fsspec.core import url_to_fs

        system, _ = url_to_fs(self.place, **self._target.options)
        return ds.dataset([system._strip_protocol(file) for file in self.files], filesystem=system, format="parquet")

    def to_pandas(self) -> pd.DataFrame:
        """All rows in memory."""
        return self.scan().to_table().to_pandas()  # type: ignore[no-any-return]


class Manifest:
    """Of which sweep a target's files are, in how many shards, and which of them are there."""

    def __init__(self, target: Target, fields: dict[str, Any]) -> None:
        self._target = target
        self._fields = fields
        self._noted = 0.0

    @classmethod
    def open(cls, target: Target, fingerprint: str, cells: int, shards: Optional[int], default: Callable[[], int]) -> Manifest:
        """The target's manifest, or a new one. Raises ValueError for that of another sweep or of other shards, OSError."""
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
            raise ValueError(f"{target.path(MANIFEST)} is no manifest of a sweep: another target, or remove it") from None
        if known != fingerprint:
            raise ValueError(f"{target.place} holds another sweep, or one of another version of hapt: another target, or remove it")
        if shards not in (None, count):
            raise ValueError(f"{target.place} holds this sweep in {count} shards, not {shards}: leave shards out, or another target")
        return cls(target, fields)

    @property
    def shards(self) -> int:
        """How many."""
        return int(self._fields["shards"])

    @property
    def missing(self) -> list[int]:
        """The shards that are not there."""
        done = set(self._fields["done"])
        return [shard for shard in range(self.shards) if shard not in done]

    def note(self, shard: int) -> None:
        """A shard is there; written now and then: one that is not noted is computed again, to the same bytes."""
        self._fields["done"].append(shard)
        if time.monotonic() - self._noted > NOTED:
            self.write()

    def write(self) -> None:
        """Writes what is noted, in one piece."""
        self._fields["done"].sort()
        self._target.write(MANIFEST, json.dumps(self._fields).encode())
        self._noted = time.monotonic()
