"""hapt as a guest: Ctrl-C, threads, memory, pickles and wrong input leave the host whole."""

import copy
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import hapt
import numpy as np
import pytest

from conftest import WALL

IS_LINUX = pathlib.Path("/proc/self/statm").exists()


# Calls that take minutes or hours; what is quicker is made again and again, for a minute at most.
LONG = """
import pathlib, sys, time
import hapt
import numpy as np

world = hapt.load(sys.stdin.read())
fine = world.set("loop.period", "1 us").set("scenarios.step.duration", "20 s")
chain = hapt.World(
    loop={"period": "1 ms"},
    device={"inertia": 6.4e-4, "damping": 1.2e-3},
    bodies={f"b{i}": {"inertia": 0.01 + 0.001 * i} for i in range(32)},
    couplings=[
        *(hapt.Spring(("puck" if i == 0 else f"b{i - 1}", f"b{i}"), stiffness=1.0 + 0.1 * i) for i in range(32)),
        *(hapt.Wall((f"b{i}", "ground"), stiffness=1.0 + i, side="above", at=1.0) for i in range(6)),
    ],
)

def check():
    chain.check()
def simulate():
    fine.simulate()
def sweep():
    fine.sweep({"couplings.0.stiffness": np.linspace(1, 2, 64)}, "settling_time", progress=False)
def boundary():
    fine.boundary({"couplings.0.stiffness": (1, 2), "loop.period": (1e-3, 2e-3)})
def worst():
    fine.worst()
def impedance():
    chain.impedance(points=100_000)
def design():
    hapt.design("45 deg", "800 N mm", "1 Hz")
def record():  # No puck explains it, so that every start is tried.
    k = np.arange(1_000_000)
    return 1e-3 * k, np.sin(1e-3 * k) + 0.1 * np.sin(7e-3 * k), np.where(k // 170 % 2 == 0, 0.05, -0.04)
def identify():
    hapt.identify(*record())
def against():
    world.against(*record())

def is_computing(task):
    try:
        return (task / "comm").read_text().strip() == "hapt"
    except OSError:  # It has ended meanwhile.
        return False

def computing():
    return sum(map(is_computing, pathlib.Path("/proc/self/task").iterdir()))

call, end = globals()[sys.argv[1]], time.monotonic() + 60.0
try:
    print("begun", flush=True)
    while time.monotonic() < end:
        call()
except KeyboardInterrupt:
    while pathlib.Path("/proc/self/task").exists() and computing():
        if time.monotonic() > end + 240.0:
            sys.exit("it computes on")
        time.sleep(0.01)
    print("interrupted")
"""


@pytest.mark.skipif(os.name != "posix", reason="no signal can be sent to a single process")
@pytest.mark.parametrize("call", ["check", "simulate", "sweep", "boundary", "worst", "impedance", "design", "identify", "against"])
def test_ctrl_c_ends_every_long_call_and_its_work(call: str) -> None:
    # A shell's background job ignores the signal, and Python then installs no handler.
    heeds = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    command = [sys.executable, "-c", heeds + LONG, call]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdin is not None and child.stdout is not None
        child.stdin.write(WALL)
        child.stdin.close()
        assert child.stdout.readline() == "begun\n"
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        assert child.stdout.read() == "interrupted\n"
    assert child.returncode == 0


FORKED = """
import os, signal, sys
import hapt
import numpy as np

world = hapt.load(sys.stdin.read())
k = np.arange(3000)
record = 1e-3 * k, np.sin(1e-2 * k) + 0.1 * np.sin(7e-2 * k), np.where(k // 170 % 2 == 0, 0.05, -0.04)

def calls():
    for call in [hapt.identify, world.set("loop.period", "1 ms").against]:
        try:
            call(*record)
        except ValueError:  # Nothing explains it.
            pass
    world.sweep({"couplings.0.stiffness": np.linspace(1, 2, 8)}, "settling_time", progress=False)

calls()
child = os.fork()
if child == 0:
    signal.alarm(120)  # Which ends it, should it wait for a thread that it does not have.
    calls()
    os._exit(0)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_forked_process_computes_as_its_parent_did() -> None:
    """A fork has none of its parent's threads: what it calls may not wait for one of them."""
    run = subprocess.run([sys.executable, "-c", FORKED], input=WALL, capture_output=True, text=True, check=True)
    assert run.stdout == "0\n"


def test_threads_run_at_the_same_time(world: hapt.World) -> None:
    expected = world.simulate()
    found: list[hapt.Run] = []
    threads = [threading.Thread(target=lambda: found.append(world.simulate())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8 and all(run == expected for run in found)


GROWTH = """
import os, pathlib, sys
import hapt
def resident():
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
text = sys.stdin.read()
def run():
    hapt.load(text).set("loop.period", "10 us").simulate()  # 50 001 rows of 8 columns: 3.2 MB
def worlds():
    for _ in range(2000):
        hapt.load(text)
def wrong():
    for _ in range(1000):
        try:
            hapt.load(text + "x")
        except hapt.WorldError:
            pass
def steps():
    device = hapt.load(text).device()
    for _ in range(100_000):
        device.step(0.0)
def arrow():
    hapt.load(text).set("loop.period", "10 us").simulate().__arrow_c_stream__()
call, times = globals()[sys.argv[1]], int(sys.argv[2])
call(), call()
before = resident()
for _ in range(times):
    call()
print(resident() - before)
"""


@pytest.mark.skipif(not IS_LINUX, reason="no /proc")
@pytest.mark.parametrize(("call", "times"), [("run", 40), ("worlds", 10), ("wrong", 20), ("steps", 10), ("arrow", 20)])
def test_calls_leave_no_memory_behind(call: str, times: int) -> None:
    """20 000 worlds, 40 runs and so on, in a process of their own; without freeing each grows by more than 30 MB."""
    grown = subprocess.run([sys.executable, "-c", GROWTH, call, str(times)], input=WALL, capture_output=True, text=True, check=True)
    assert int(grown.stdout) < 16e6


def test_a_loop_and_its_world_change_apart(world: hapt.World) -> None:
    loop, soft = world.loop(), world.set("couplings.0.stiffness", 1.0)
    assert loop.step(0.1) == -0.2
    assert soft.loop().step(0.1) == -0.1 and loop.step(0.1) == -0.2
    with pytest.raises(AttributeError):
        world.scenarios = []  # type: ignore[misc]
    with pytest.raises(hapt.WorldError):
        world.set("couplings.0.stiffness", -1)
    assert loop.step(0.1) == -0.2


def test_whatever_a_call_gives_goes_to_another_process(world: hapt.World) -> None:
    plane: dict[str, Any] = {"couplings.0.stiffness": (1.0, 5.0), "device.damping": (5e-4, 3e-3)}
    made: Any
    for made in [
        world.simulate(),
        world.check(),
        world.impedance(points=5),
        world.sweep({"loop.period": [1e-3, 2e-3]}, "certified"),
        world.boundary(plane, "passive"),
        world.worst(),
        hapt.design("45 deg", "800 N mm", "1 Hz"),
        world.to_toml(),
        hapt.Wall(("puck", "ground"), stiffness=1, side="above", at="10 deg"),
    ]:
        again = pickle.loads(pickle.dumps(made))
        assert type(again) is type(made) and repr(again) == repr(made)
        if hasattr(made, "to_pandas"):
            assert again.to_pandas().equals(made.to_pandas())


def test_a_device_goes_on_from_its_pickle_whatever_hand_moves_it() -> None:
    hands = {
        "step": hapt.Step("10 deg", at="20 ms", release="50 ms"),
        "torque": hapt.Torque(hapt.Sine("20 N mm", "40 Hz")),
        "grip": hapt.Grip(hapt.Ramp("10 deg", "30 ms"), inertia=1e-4, damping=1e-3, stiffness=1.0, hold="17 ms", open="9 ms"),
    }
    world = hapt.World(
        loop={"period": "1 ms", "delay": "2.3 ms"},
        device={"inertia": "6.4e-4 kg m^2", "friction": "5 N mm"},
        scenarios={name: {"duration": "1 s", "hand": hand} for name, hand in hands.items()},
    )
    for name in hands:
        device = world.device(name)
        again = world.device(name)
        for k in range(200):
            if k % 23 == 0:
                again = pickle.loads(pickle.dumps(device))
                assert again.puck == device.puck and again.applied == device.applied
            torque = float(0.03 * np.sin(0.2 * k))
            assert device.step(torque) == again.step(torque)


def test_a_state_of_something_else_is_refused(world: hapt.World) -> None:
    loop, device = world.loop(), world.device()
    for wrong in [b"", b"\xff" * 40, device._native.get_state() + b"0"]:
        with pytest.raises(ValueError, match="no state"):
            device._native.set_state(wrong)
        with pytest.raises(ValueError, match="no state"):
            loop._native.set_state(wrong)
    assert loop.step(0.1) == -0.2


def test_arrays_of_every_kind_are_numbers_or_an_error(world: hapt.World) -> None:
    k = np.arange(3000)
    record = np.zeros((3000, 3))
    record[:, 0], record[:, 2] = 1e-3 * k, np.where((k // 170) % 2 == 0, 0.05, -0.04)
    device = world.device()
    record[:, 1] = [device.puck[0]] + [device.step(torque)[0] for torque in record[:-1, 2]]
    expected = dict(hapt.identify(*record.T.copy()))
    frozen = record.T
    frozen.flags.writeable = False
    assert not frozen[0].flags.c_contiguous and dict(hapt.identify(*frozen)) == expected
    times, positions, torques = record.T
    assert dict(hapt.identify(list(times), list(positions), list(torques))) == expected
    wrong: list[tuple[Any, type[Exception]]] = [
        (positions[:-1], ValueError),
        (positions[:, None], ValueError),
        (positions + 0j, TypeError),
        (positions.astype(str), TypeError),
        (positions.astype(object), TypeError),
        (positions > 0, TypeError),
        (np.where(k == 7, np.inf, positions), ValueError),
        (None, TypeError),
    ]
    for values, error in wrong:
        with pytest.raises(error):
            hapt.identify(times, values, torques)
    for known in [-1.0, 0.0, np.nan, "heavy", [1.0]]:
        with pytest.raises((TypeError, ValueError), match="inertia"):
            hapt.identify(times, positions, torques, inertia=known)  # type: ignore[arg-type]
    masked = np.ma.array(positions, mask=k == 7)
    with pytest.raises(ValueError, match="positions: elements are masked"):
        hapt.identify(times, masked, torques)
    with pytest.raises(ValueError, match="loop.period"):
        world.sweep({"loop.period": [[1e-3], [2e-3, 3e-3]]}, "certified")


def test_what_is_no_argument_is_named(world: hapt.World, tmp_path: pathlib.Path) -> None:
    plane: dict[str, Any] = {"loop.period": (1e-3, 2e-3), "device.damping": (1e-3, 2e-3)}
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: world.impedance(points=-1), "points is -1"),
        (lambda: world.impedance(points=0), "points is 0"),
        (lambda: world.impedance(points=10**30), "points is 1"),
        (lambda: world.impedance(points=1.5), "points is 1.5"),  # type: ignore[arg-type]
        (lambda: world.boundary(list(plane)), "ranges is a mapping"),  # type: ignore[arg-type]
        (lambda: world.sweep(None, "certified"), "axes is a mapping"),  # type: ignore[call-overload]
        (lambda: world.sweep({3: [1e-3]}, "certified"), "a key is a dotted path"),  # type: ignore[dict-item]
        (lambda: world.sweep({"loop.period": [1e-3]}, "certified", shards=True), "shards is True"),
        (lambda: world.sweep({"loop.period": [1e-3]}, "certified", storage_options={}), "storage_options are given without out"),  # type: ignore[call-overload]
    ]
    for call, message in wrong:
        with pytest.raises((TypeError, ValueError), match=message):
            call()
    assert world.boundary(plane, "passive").keys == ("loop.period", "device.damping")
