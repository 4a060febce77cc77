"""A sweep in shards, end to end: `cargo xtask bench scale`. Arguments: the number of loops, the number of processes. Prints Markdown."""

import os
import pathlib
import resource
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import hapt
import numpy as np

MEASURE = "held_verdict"


def grid(cells):
    """Stiffness and inertia; `cells` is a square."""
    side = round(cells**0.5)
    return {"couplings.0.stiffness": np.linspace(0.5, 2.0, side), "bodies.wheel.inertia": np.linspace(0.01, 0.05, side)}


def swept(cells, shards, pool, processes):
    """Seconds, bytes of the files and the number of shards of a sweep into a folder."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        data = world.sweep(grid(cells), MEASURE, client=pool, shards=shards, out=folder, progress=False)
        spent = time.perf_counter() - began
        return spent, sum(path.stat().st_size for path in pathlib.Path(folder).iterdir()), len(data.files)


def human(seconds):
    for most, unit in [(120, "s"), (7200, "min"), (172800, "h"), (6.3e7, "days")]:
        if seconds < most:
            return f"{seconds / {'s': 1, 'min': 60, 'h': 3600, 'days': 86400}[unit]:.3g} {unit}"
    return f"{seconds / 3.15576e7:.3g} years"


if __name__ == "__main__":
    cells, processes = int(float(sys.argv[1])), int(sys.argv[2])
    world = hapt.load("@notes/euler")
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        list(pool.map(abs, range(4 * processes)))  # they are up
        # A few cells in many shards: what a shard costs beside its work.
        few, many = (swept(2500, shards, pool, processes)[0] for shards in (1, 401))
        overhead = max(many - few, 0.0) / 400
        spent, size, shards = swept(cells, None, pool, processes)
        done = round(cells**0.5) ** 2
    memory = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
    print(
        f"`{MEASURE}` of {done:.3g} loops of the notes' wheel, {processes} worker processes on {os.cpu_count()} cores, into a folder of Parquet files:\n"
    )
    print("| | |\n| --- | --- |")
    print(f"| end to end | {spent:.1f} s in {shards} shards, {done / spent:.3g} loops per s |")
    print(f"| a shard beside its work: task, grid, file, manifest | {1e3 * overhead:.1f} ms |")
    print(f"| largest process | {memory:.0f} MiB |")
    print(f"| files | {size / 2**20:.0f} MiB, {size / done:.2f} bytes a loop |")
    print("\nFrom that, on paper, at the same rate a core:\n")
    print("| loops | 1 core | 1000 cores | files |\n| --- | --- | --- | --- |")
    for power in (10, 12):
        seconds = 10**power * spent * min(processes, os.cpu_count() or 1) / done
        print(f"| 10^{power} | {human(seconds)} | {human(seconds / 1000)} | {10**power * size / done / 2**30:.3g} GiB |")
