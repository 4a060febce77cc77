"""A sweep beyond one process gives the rows and the bytes of one."""

import dataclasses
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any

import hapt
import numpy as np
import pytest
from hapt._shards import Job, compute

from conftest import WALL

AXES: dict[str, Any] = {"couplings.0.stiffness": np.geomspace(0.5, 8.0, 30), "loop.period": np.linspace(1e-3, 3e-3, 7)}
MEASURES = ["required_damping", "settling_time", "certified"]


def same(a: hapt.Sweep, b: hapt.Sweep) -> bool:
    return list(a) == list(b) and all(a[name].tobytes() == b[name].tobytes() for name in a)


def files(place: pathlib.Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(place.glob("part-*"))}


def spawned(workers: int) -> Executor:
    """Processes that begin anew: a fork of a process with threads may not go on."""
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def test_an_executor_gives_the_rows_of_one_process(world: hapt.World) -> None:
    whole = world.sweep(AXES, MEASURES, progress=False)
    with ThreadPoolExecutor(3) as threads, spawned(2) as processes:
        for client in [threads, processes]:
            for shards in [None, 1, 7, 300]:  # also more shards than cells
                assert same(world.sweep(AXES, MEASURES, client=client, shards=shards, progress=False), whole)


def test_files_are_the_table_shard_by_shard(world: hapt.World, tmp_path: pathlib.Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    serial = world.sweep(AXES, MEASURES, shards=5, out=tmp_path / "serial", progress=False)
    with ThreadPoolExecutor(3) as threads:
        spread = world.sweep(AXES, MEASURES, client=threads, shards=5, out=f"file://{tmp_path}/spread", progress=False)
    assert files(tmp_path / "serial") == files(tmp_path / "spread") and len(serial.files) == 5
    whole = world.sweep(AXES, MEASURES, progress=False)
    assert serial.scan().to_table() == arrow.table(whole) == spread.scan().to_table()
    assert serial.cells == 210 and [path.name for path in (tmp_path / "serial").glob(".*")] == []


def test_pandas_polars_and_duckdb_read_the_files(world: hapt.World, tmp_path: pathlib.Path) -> None:
    pandas, polars, duckdb = (pytest.importorskip(name) for name in ["pandas", "polars", "duckdb"])
    pytest.importorskip("pyarrow")
    data = world.sweep(AXES, MEASURES, shards=4, out=tmp_path, progress=False)
    frame = world.sweep(AXES, MEASURES, progress=False).to_pandas()
    pandas.testing.assert_frame_equal(pandas.read_parquet([file for file in data.files]), frame)
    pandas.testing.assert_frame_equal(data.to_pandas(), frame)
    certified = frame["certified"].sum()
    assert polars.scan_parquet(data.glob).select(polars.col("certified").sum()).collect().item() == certified
    assert duckdb.sql(f"SELECT sum(certified) FROM '{data.glob}'").fetchall()[0][0] == certified


class Dying(ThreadPoolExecutor):
    """Fails as a machine does: after some shards."""

    def __init__(self, after: int, error: BaseException) -> None:
        super().__init__(1)
        self.left, self.error = after, error

    def submit(self, *arguments: Any, **named: Any) -> Any:
        self.left -= 1
        if self.left < 0:
            raise self.error
        return super().submit(*arguments, **named)


def test_a_sweep_goes_on_where_it_was(world: hapt.World, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyarrow")
    whole = files(pathlib.Path(world.sweep(AXES, MEASURES, shards=6, out=tmp_path / "whole", progress=False).place))
    at = tmp_path / "ended"
    with pytest.raises(OSError, match="gone"), Dying(3, OSError("the machine is gone")) as dying:
        world.sweep(AXES, MEASURES, client=dying, shards=6, out=at, progress=False)
    # Shards that are there and noted are not touched again.
    done = json.loads((at / "_manifest.json").read_text())["done"]
    for shard in done:
        (at / f"part-{shard:08}.parquet").write_bytes(b"as it was")
    again = world.sweep(AXES, MEASURES, out=at, progress=False)
    assert len(again.files) == 6
    for name, data in files(at).items():
        assert data == (b"as it was" if int(name[5:13]) in done else whole[name])
    # All of it is there.
    before = {path: path.stat().st_mtime_ns for path in at.iterdir()}
    world.sweep(AXES, MEASURES, out=at, progress=False)
    assert before == {path: path.stat().st_mtime_ns for path in at.iterdir()}


def test_another_sweep_is_refused(world: hapt.World, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyarrow")
    world.sweep(AXES, MEASURES, shards=2, out=tmp_path, progress=False)
    before = files(tmp_path)
    for changed in [world.set("device.damping", 2e-3), world.set("loop.delay", "1 ms")]:
        with pytest.raises(ValueError, match="another sweep"):
            changed.sweep(AXES, MEASURES, out=tmp_path, progress=False)
    with pytest.raises(ValueError, match="another sweep"):
        world.sweep(AXES, MEASURES[:1], out=tmp_path, progress=False)
    with pytest.raises(ValueError, match="2 shards"):
        world.sweep(AXES, MEASURES, shards=3, out=tmp_path, progress=False)
    (tmp_path / "_manifest.json").write_text("{}")
    with pytest.raises(ValueError, match="no manifest"):
        world.sweep(AXES, MEASURES, out=tmp_path, progress=False)
    assert files(tmp_path) == before


def test_a_worker_of_another_version_is_an_error(world: hapt.World) -> None:
    job = dataclasses.replace(Job(world._native.parts(), AXES, MEASURES, None), version="0.0.1")
    with pytest.raises(RuntimeError, match="0.0.1"):
        compute(job, "", 0, 1, 1, None, "")


def test_a_file_that_the_world_names_is_a_part_of_the_sweep(tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "wall.toml").write_text(WALL.replace('kind = "step", to = "10 deg", release = "0.1 s"', 'kind = "path", file = "p.csv"'))
    path, out = tmp_path / "p.csv", tmp_path / "out"
    path.write_text("time_s,puck_deg\n0,0\n0.1,10\n")
    world = hapt.load(tmp_path / "wall.toml")
    world.sweep(AXES, "peak_torque", shards=2, out=out, progress=False)
    before = files(out)
    job = Job(world._native.parts(), AXES, ["peak_torque"], None)
    fingerprint = job.fingerprint(job.grid())
    path.write_text("time_s,puck_deg\n0,0\n0.1,20\n")
    with pytest.raises(RuntimeError, match="another content"):  # a worker on another machine, with another file
        compute(job, fingerprint, 0, 1, 1, None, "")
    with pytest.raises(ValueError, match="another sweep"):
        world.sweep(AXES, "peak_torque", out=out, progress=False)
    assert files(out) == before


def test_a_client_that_is_gone_is_an_error_and_leaves_the_target(world: hapt.World, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyarrow")
    gone = ThreadPoolExecutor(1)
    gone.shutdown()
    with pytest.raises(RuntimeError, match="shutdown"):
        world.sweep(AXES, MEASURES, client=gone, shards=3, out=tmp_path, progress=False)
    assert files(tmp_path) == {}
    assert len(world.sweep(AXES, MEASURES, out=tmp_path, progress=False).files) == 3


def test_what_is_no_client_or_number_is_refused(world: hapt.World) -> None:
    with pytest.raises(TypeError, match="Executor"):
        world.sweep(AXES, MEASURES, client="tcp://here")
    wrong: list[dict[str, Any]] = [{"shards": 0}, {"shards": 1.5}, {"threads": -1}, {"threads": 2000}]
    for named in wrong:
        with pytest.raises(ValueError, match=next(iter(named))):
            world.sweep(AXES, MEASURES, **named)


def test_a_killed_worker_s_shards_run_again(world: hapt.World) -> None:
    whole = world.sweep(AXES, MEASURES, progress=False)
    slow = world.set("scenarios.step.duration", "20 s")
    with spawned(2) as pool:
        pool.submit(os.getpid).result()
        victims = [pool.submit(os.getpid).result()]
        threading.Timer(0.3, lambda: os.kill(victims[0], signal.SIGKILL)).start()
        with pytest.warns(RuntimeWarning, match="broken"):
            sweep = slow.sweep(AXES, ["peak_torque", "settling_time"], client=pool, shards=60, progress=False)
    assert same(sweep, slow.sweep(AXES, ["peak_torque", "settling_time"], progress=False))
    assert same(world.sweep(AXES, MEASURES, progress=False), whole)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Unix")
def test_a_target_that_takes_nothing_is_an_error_and_stays_as_it_is(world: hapt.World, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyarrow")
    with pytest.raises(OSError):
        world.sweep(AXES, MEASURES, out="/proc/nowhere", progress=False)
    (tmp_path / "file").write_text("as it was")
    with pytest.raises(OSError):
        world.sweep(AXES, MEASURES, out=tmp_path / "file", progress=False)
    assert (tmp_path / "file").read_text() == "as it was"


FULL = """
import resource, signal, sys
import hapt, numpy as np
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
world, out = hapt.load(sys.stdin.read()), sys.argv[1]
axes = {"couplings.0.stiffness": np.geomspace(0.5, 8.0, 3000)}
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))  # a disk that takes no more
try:
    world.sweep(axes, "required_damping", out=out, shards=2, progress=False)
except OSError as error:
    print(error.errno)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
print(world.sweep(axes, "required_damping", out=out, progress=False).cells)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="RLIMIT_FSIZE")
def test_a_full_disk_leaves_whole_files_and_the_sweep_goes_on(tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyarrow")
    ended = subprocess.run([sys.executable, "-c", FULL, str(tmp_path)], input=WALL, capture_output=True, text=True)
    assert ended.stdout.split() == ["27", "3000"], ended
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.fixture
def bucket() -> Iterator[dict[str, Any]]:
    """An S3 server that runs here."""
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    import s3fs

    options: dict[str, Any] = {"key": "k", "secret": "s", "endpoint_url": f"http://{host}:{port}"}
    s3fs.S3FileSystem(**options).mkdir("bucket")
    yield options
    server.stop()


def test_an_object_store_takes_the_same_files(world: hapt.World, tmp_path: pathlib.Path, bucket: dict[str, Any]) -> None:
    pytest.importorskip("pyarrow")
    import s3fs

    world.sweep(AXES, MEASURES, shards=3, out=tmp_path, progress=False)
    with ThreadPoolExecutor(2) as threads:
        data = world.sweep(
            AXES, MEASURES, client=threads, shards=3, out="s3://bucket/sweep", storage_options=bucket, progress=False
        )
    store = s3fs.S3FileSystem(**bucket)
    assert {path.split("/")[-1]: store.cat_file(path) for path in store.ls("bucket/sweep") if "part-" in path} == files(tmp_path)
    assert data.scan().to_table() == world.sweep(AXES, MEASURES, out=tmp_path, progress=False).scan().to_table()
    with pytest.raises(ValueError, match="another sweep"):
        world.sweep(AXES, MEASURES[:1], out="s3://bucket/sweep", storage_options=bucket, progress=False)


class Cluster:
    """A scheduler of Dask and workers, each a process of its own."""

    def __init__(self, at: pathlib.Path, workers: int) -> None:
        self.file = at / f"scheduler-{time.monotonic_ns()}.json"
        self.scheduler = self._begun("dask_scheduler", "--port", "0", "--host", "127.0.0.1")
        self.workers = [self._begun("dask_worker", "--nthreads", "1", "--no-nanny") for _ in range(workers)]

    def _begun(self, part: str, *words: str) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", f"distributed.cli.{part}", "--scheduler-file", str(self.file), "--no-dashboard"]
        process = subprocess.Popen([*command, *words], stderr=subprocess.DEVNULL)
        while part == "dask_scheduler" and not self.file.exists():
            assert process.poll() is None
            time.sleep(0.01)
        return process

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *_: object) -> None:
        for process in [self.scheduler, *self.workers]:
            process.kill()
            process.wait()


def test_dask_s_workers_and_its_scheduler_may_be_killed(world: hapt.World, tmp_path: pathlib.Path) -> None:
    distributed = pytest.importorskip("distributed")
    pytest.importorskip("pyarrow")
    slow = world.set("scenarios.step.duration", "20 s")
    measures = ["peak_torque", "settling_time"]
    whole = slow.sweep(AXES, measures, shards=40, out=tmp_path / "whole", progress=False)
    at = tmp_path / "spread"

    def there() -> int:
        return len(list(at.glob("part-*")))

    with Cluster(tmp_path, 2) as cluster, distributed.Client(scheduler_file=str(cluster.file)) as client:

        def kill() -> None:
            for count, process in [(2, cluster.workers[0]), (10, cluster.scheduler)]:
                while there() < count:
                    time.sleep(0.01)
                process.kill()

        killer = threading.Thread(target=kill)
        killer.start()
        with pytest.raises(RuntimeError, match="scheduler is gone"):
            slow.sweep(AXES, measures, client=client, shards=40, out=at, progress=False)
        killer.join()
    assert 10 <= there() < 40
    with Cluster(tmp_path, 2) as cluster, distributed.Client(scheduler_file=str(cluster.file)) as client:
        slow.sweep(AXES, measures, client=client, out=at, progress=False)
    assert files(at) == files(pathlib.Path(whole.place))
