"""hapt as a guest: Ctrl-C, threads, memory, pickles and wrong input leave the host whole."""

import copy
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


def computing() -> int:
    """How many of hapt's threads run."""
    names = [task / "comm" for task in pathlib.Path("/proc/self/task").iterdir()]
    return sum(name.exists() and name.read_text().strip() == "hapt" for name in names)


@pytest.mark.parametrize("call", ["check", "simulate", "sweep", "boundary", "worst"])
def test_ctrl_c_ends_every_long_call(call: str) -> None:
    long = hapt.load(WALL).set("loop.period", "1 us").set("scenarios.step.duration", "20 s")

    def again_and_again(call: Callable[[], object]) -> None:
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            call()

    calls: dict[str, Callable[[], object]] = {
        "check": lambda: again_and_again(long.check),
        "simulate": lambda: long.simulate(),
        "sweep": lambda: long.sweep({"couplings.0.stiffness": np.linspace(1, 2, 64)}, "settling_time", progress=False),
        "boundary": lambda: again_and_again(
            lambda: long.boundary({"couplings.0.stiffness": (1, 2), "loop.period": (1e-3, 2e-3)})
        ),
        "worst": lambda: again_and_again(long.worst),
    }
    # A real Ctrl-C: the default handler raises KeyboardInterrupt in the main thread. A shell's background job ignores the signal, and
    # Python then installs no handler.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.2, lambda: signal.raise_signal(signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            calls[call]()
    finally:
        timer.join()
        signal.signal(signal.SIGINT, before)
    # The computation ends too, however long the machine takes.
    while IS_LINUX and computing():
        time.sleep(0.01)


def test_threads_run_beside_each_other(world: hapt.World) -> None:
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
    for _ in range(10_000):
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
    """100 000 worlds, 40 runs and so on, in a process of their own; without freeing each grows by more than 60 MB."""
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
