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


def processor():
    """Processor time in s of this process and of its children that have ended."""
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in uses)


def pool_of(processes):
    pool = ProcessPoolExecutor(processes, mp_context=get_context("spawn"))
    list(pool.map(abs, range(4 * processes)))  # they are up
    return pool


if __name__ == "__main__":
    cells, processes = int(float(sys.argv[1])), int(sys.argv[2])
    world = hapt.load("@notes/euler")
    with pool_of(processes) as pool:
        # A few cells in many shards: what a shard costs beside its work.
        few, many = (swept(2500, shards, pool, processes)[0] for shards in (1, 401))
    overhead = max(many - few, 0.0) / 400
    before = processor()
    with pool_of(processes) as pool:
        spent, size, shards = swept(cells, None, pool, processes)
    work, done = processor() - before, round(cells**0.5) ** 2
    own, workers = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(
        f"`{MEASURE}` of {done:.3g} loops of the notes' wheel, {processes} worker processes on {os.cpu_count()} cores, into a folder of Parquet files. The"
        " processor time is that of all processes with their start; the time that passed is also that of whatever else ran here.\n"
    )
    print("| | |\n| --- | --- |")
    print(f"| end to end | {spent:.1f} s passed, {work:.1f} s of processor time, in {shards} shards |")
    print(f"| loops | {done / work:.3g} per s of processor time |")
    print(f"| a shard beside its work: task, grid, file, manifest | {1e3 * overhead:.1f} ms passed |")
    print(f"| memory of the process that hands out the shards | {own:.0f} MiB |")
    print(f"| memory of the largest worker | {workers:.0f} MiB |")
    print(f"| files | {size / 2**20:.1f} MiB, {size / done:.2f} bytes a loop |")
    a_shard = done / work  # The default: about a second of work.
    print(
        f"\nFrom that, on paper, each core at this rate. A shard is a second of work, {a_shard:.2g} loops, so that the {1e3 * overhead:.1f} ms"
        f" beside it are {100 * overhead:.2g} % of it:\n"
    )
    print("| loops | shards | 1 core | 1000 cores | files |\n| --- | --- | --- | --- | --- |")
    for power in (10, 12):
        loops = 10**power
        seconds = loops / a_shard * (1 + overhead)
        print(
            f"| 10^{power} | {loops / a_shard:.2g} | {human(seconds)} | {human(seconds / 1000)} | {loops * size / done / 2**30:.3g} GiB |"
        )
