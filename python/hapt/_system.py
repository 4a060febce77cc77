"""Boundaries and sweeps of a world or network over the values of keys."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Optional, Union, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _hapt, _toml
from ._analyses import Boundary, Piece
from ._arrays import numbers
from ._shards import Dataset, Job
from ._sweep import Sweep, here, in_shards
from ._target import Target


class System:
    """The base of `World`: boundaries and sweeps."""

    _native: _hapt.World

    def boundary(
        self, ranges: Mapping[str, Sequence[Any]], claims: Union[str, Iterable[str]] = (), log: bool = False
    ) -> Boundary:
        """The boundaries of claims in the plane of two keys: the edges at which a claim stops holding.

        Claims of a world: stability ("held", "free") and passivity ("passive") of the linear loop at even times, and the certificate
        ("certified") for the file's times and tolerances. Claims of a network: passivity for any clocks and any loss ("passive"), and for the
        file's own times ("fixed"). The default is all of them.

        `ranges` maps each of the two keys to its two ends, strings with units or numbers in SI. With `log` the axes are logarithmic. Raises
        ValueError for an unknown claim or bad ranges, WorldError for ends that the world file would refuse.
        """
        _mapping("ranges", ranges)
        if len(ranges) != 2 or any(isinstance(ends, str) or len(ends) != 2 for ends in ranges.values()):
            raise ValueError('ranges maps two keys to two ends each, such as {"loop.period": ("1 ms", "10 ms"), ...}')
        spelled = [
            f"{a_key(key)}={'..'.join(text_of(end, key) for end in ends)}{':log' if log else ''}" for key, ends in ranges.items()
        ]
        names = _names("claims", claims)
        pieces, claimed = self._native.boundary(spelled, names)
        first, second = ranges
        return Boundary(
            (first, second),
            [Piece(*piece) for piece in pieces],
            {claim: everywhere for claim, everywhere, _, _ in claimed},
            {claim: lost for claim, _, lost, _ in claimed},
            {claim: reason for claim, _, _, reason in claimed if reason is not None},
        )

    @overload
    def sweep(
        self,
        axes: Mapping[str, ArrayLike],
        measures: Union[str, Sequence[str]],
        scenario: Optional[str] = None,
        progress: Optional[bool] = None,
        threads: Optional[int] = None,
        *,
        client: Any = None,
        shards: Optional[int] = None,
        out: None = None,
        storage_options: None = None,
    ) -> Sweep: ...
    @overload
    def sweep(
        self,
        axes: Mapping[str, ArrayLike],
        measures: Union[str, Sequence[str]],
        scenario: Optional[str] = None,
        progress: Optional[bool] = None,
        threads: Optional[int] = None,
        *,
        client: Any = None,
        shards: Optional[int] = None,
        out: Union[str, os.PathLike[str]],
        storage_options: Optional[Mapping[str, Any]] = None,
    ) -> Dataset: ...
    def sweep(
        self,
        axes: Mapping[str, ArrayLike],
        measures: Union[str, Sequence[str]],
        scenario: Optional[str] = None,
        progress: Optional[bool] = None,
        threads: Optional[int] = None,
        *,
        client: Any = None,
        shards: Optional[int] = None,
        out: Union[str, os.PathLike[str], None] = None,
        storage_options: Optional[Mapping[str, Any]] = None,
    ) -> Union[Sweep, Dataset]:
        """Measures the world or network at every combination of the keys' values.

        `axes` maps each key to its values in SI, shape (n,). `measures` are names of `hapt.measures()`; those of a run need a scenario. A
        progress bar is shown where tqdm is installed, unless `progress` is False.

        `threads` is the number of threads of each process, 0 for all cores; the default is 0, with a client 1. `client` computes the table in
        shards: a `concurrent.futures.Executor`, a Dask client, or the module ray. `out`, a folder or a URL for fsspec with its
        `storage_options`, gets a Parquet file for each shard and needs pyarrow; the same call continues an interrupted one. `shards` is their
        number, by default such that each takes about a second. The values depend on none of these.

        Raises ValueError for an unknown measure or values that are not finite, WorldError for values that the world file would refuse; with
        `out` OSError where it cannot be written, and ValueError where it holds another sweep. Finished shards remain.

        >>> import hapt, numpy as np
        >>> world = hapt.load("@notes/euler")
        >>> sweep = world.sweep({"loop.period": np.linspace(1e-3, 4e-3, 4)}, "held_growth_per_s", progress=False)
        >>> sweep["held_growth_per_s"].shape
        (4,)
        """
        _mapping("axes", axes)
        values = {a_key(key): numbers(key, array) for key, array in axes.items()}
        names = _names("measures", measures)
        if scenario is not None:
            a_scenario(scenario)
        for name, number, least, most in [("threads", threads, 0, 1024), ("shards", shards, 1, 10**8)]:
            if number is not None:
                whole(name, number, least, most)
        if storage_options is not None and out is None:
            raise ValueError("storage_options are given without out, to which they belong")
        job = Job(self._native.parts(), values, names, scenario)
        grid = job.grid()
        if client is None and out is None:
            return here(job, grid, progress, threads or 0)
        target = None if out is None else Target(out, storage_options)
        return in_shards(job, grid, progress, threads, client, shards, target)


def a_key(key: object) -> str:
    if not isinstance(key, str):
        raise TypeError(f"a key is a dotted path such as 'loop.period', not {type(key).__name__}")
    if "=" in key:
        raise ValueError(f"{key!r} is no key: a key is a dotted path such as 'loop.period', without '='")
    return key


def a_scenario(name: object) -> str:
    if not isinstance(name, str):
        raise TypeError(f"scenario must be a name, not {type(name).__name__}")
    return name


def items(name: str, value: Any) -> list[Any]:
    try:
        return list(value)
    except TypeError:
        raise TypeError(f"{name} must be a sequence, not {type(value).__name__}") from None


def _names(name: str, value: Any) -> list[str]:
    names = [value] if isinstance(value, str) else items(name, value)
    for each in names:
        if not isinstance(each, str):
            raise TypeError(f"{name} must be names, not {type(each).__name__}")
    return names


def _mapping(name: str, value: object) -> None:
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} is a mapping of keys such as 'loop.period', not {type(value).__name__}")


def whole(name: str, value: object, least: int, most: int) -> None:
    if not (isinstance(value, (int, np.integer)) and not isinstance(value, bool) and least <= value <= most):
        raise ValueError(f"{name} is {value!r}, but must be a whole number from {least} to {most}")


def text_of(value: Any, name: str) -> str:
    value = _toml.plain(value, name)
    if isinstance(value, (dict, list, bool)):
        raise TypeError(f"{name}: a string with a unit or a number is expected, not {type(value).__name__}")
    return value if isinstance(value, str) else repr(value)
