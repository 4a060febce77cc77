"""Against python-control, which shares no code with hapt."""

import warnings
from typing import Any, Optional

import hapt
import numpy as np
import pytest

control = pytest.importorskip("control")

METHODS = ["zoh", "forward-euler", "backward-euler", "semi-implicit-euler", "trapezoidal", "rk4", "tustin", "foh"]


HANDLE = {"inertia": 5e-4, "stiffness": 20.0, "damping": 1e-3}


def random_world(
    rng: np.random.Generator, device: Optional[dict[str, Any]] = None, integral: float = 0.0, along: float = 0.0, **loop: Any
) -> hapt.World:
    """A body on a spring and a damper, all tied to ground, so that every mode decays; and an integral term and a torque along the acceleration at the puck."""

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    return hapt.World(
        loop={"period": 1e-3, "estimator": "difference", **loop},
        device={"inertia": 6.4e-4, "damping": log(1e-4, 1e-2), **(device or {})},
        bodies={"wheel": {"inertia": log(3e-4, 3e-2)}},
        couplings=[
            hapt.Spring(("puck", "wheel"), stiffness=log(0.3, 10)),
            hapt.Damper(("puck", "wheel"), damping=log(1e-5, 1e-3)),
            hapt.Spring(("wheel", "ground"), stiffness=log(0.03, 1)),
            hapt.Damper(("wheel", "ground"), damping=log(1e-3, 3e-2)),
            *([hapt.Integral(("ground", "puck"), stiffness=integral, time=0.5)] if integral else []),
            *([hapt.Acceleration(("ground", "puck"), inertia=along, cutoff=20.0)] if along else []),
        ],
    )


@pytest.mark.parametrize("estimator", ["exact", "difference", "low-pass", "foaw", "foaw-best", "kalman", "levant"])
@pytest.mark.parametrize("delay", [0.0, 0.4e-3, 1e-3, 2.7e-3])
@pytest.mark.parametrize("more", [{}, {"filter": 60.0, "every": 4}, {"integral": 0.3}, {"integral": 0.3, "filter": 60.0}, {"integral": 0.3, "along": 1e-4}, {"along": 5e-5}])
def test_the_loop_s_state_space_has_the_eigenvalues_of_the_check(
    estimator: str, delay: float, more: dict[str, Any]
) -> None:
    rng = np.random.default_rng(7)
    for method in METHODS:
        loop: dict[str, Any] = {"method": method, "estimator": estimator, "delay": delay, "cutoff": 80.0, "window": 5, "acceleration": 1e3}
        loop.update(more)
        world = random_world(rng, **loop)
        ours = np.abs(np.linalg.eigvals(world.to_control().loop.A))
        free = world.check(remedies=False).free
        if estimator.startswith("foaw"):  # The check takes the worse of its windows.
            assert max(ours) <= free["spectral_radius"] + 1e-9
            continue
        theirs = [value["abs"] for value in free["eigenvalues"]]
        large = np.sort(ours[ours > 1e-3])[::-1]
        assert large == pytest.approx(theirs[: len(large)], abs=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.4e-3, 2.7e-3])
@pytest.mark.parametrize("lag", [0.0, 0.3e-3, 4e-3])
@pytest.mark.parametrize("handle", [{}, {"handle": HANDLE}])
def test_a_lagging_motor_and_a_handle_are_in_the_loop(delay: float, lag: float, handle: dict[str, Any]) -> None:
    rng = np.random.default_rng(8)
    for method in METHODS:
        world = random_world(rng, {"lag": lag, **handle}, method=method, delay=delay)
        ours = np.sort(np.abs(np.linalg.eigvals(world.to_control().loop.A)))[::-1]
        theirs = [value["abs"] for value in world.check(remedies=False).free["eigenvalues"]]
        large = ours[ours > 1e-3]
        assert large == pytest.approx(theirs[: len(large)], abs=1e-9)


@pytest.mark.parametrize("integral", [0.0, 0.3])
@pytest.mark.parametrize("along", [0.0, 1e-4])
def test_the_world_s_state_space_gives_the_torque_of_the_loop(integral: float, along: float) -> None:
    rng = np.random.default_rng(3)
    for method in METHODS:
        world = random_world(rng, integral=integral, along=along, method=method, estimator="exact")
        system = world.to_control().world
        puck = rng.normal(size=(2, 40))
        puck[:, 0] = 0.0  # tustin and foh begin at x_0, whatever the first sample
        loop = world.loop()
        torque = [loop.step(z, v) for z, v in puck.T]
        expected = control.forced_response(system, np.arange(40) * 1e-3, puck).outputs
        assert torque == pytest.approx(np.ravel(expected), abs=1e-9 * np.abs(torque).max())


def test_the_device_s_state_space_has_its_step_response() -> None:
    time = np.arange(200) * 1e-3
    for parts in ({}, {"lag": 1.3e-3}, {"handle": HANDLE}, {"lag": 1.3e-3, "handle": HANDLE}):
        world = random_world(np.random.default_rng(5), parts)
        expected = control.forced_response(world.to_control().device, time, np.full(200, 0.01)).outputs
        device = world.device()
        rows = [device.puck] + [device.step(0.01) for _ in time[1:]]
        assert np.array(rows).T == pytest.approx(expected, rel=1e-6, abs=1e-12)


def positive_real(world: hapt.World, damping: float) -> Any:
    """G = b/T + H/(z - 1): passive where the loop is against every passive hand (Colgate and Schenkel 1997).

    H is the torque that resists a sampled position, with the difference as velocity: (z - 1)/(T z). So the world is driven by
    1/(z - 1) as position and 1/(T z) as velocity.
    """
    system = world.to_control().world
    period = float(world.get("loop.period") or 0.0)
    order = len(system.A)
    drive = np.diag([1.0, 1.0 / period])
    a = np.block([[np.diag([1.0, 0.0]), np.zeros((2, order))], [system.B @ drive, system.A]])
    b = np.vstack([np.ones((2, 1)), np.zeros((order, 1))])
    c = -np.hstack([system.D @ drive, system.C])
    return control.ss(a, b, c, [[damping / period]], period)


def test_check_and_python_control_agree_on_passivity() -> None:
    pytest.importorskip("cvxopt")
    rng = np.random.default_rng(11)
    looked, near, wrong = 0, 0, list[Any]()
    verdicts = {True: 0, False: 0}
    while looked < 300:
        method = METHODS[rng.integers(len(METHODS))]
        world = random_world(rng, method=method)
        damping = float(np.exp(rng.uniform(np.log(1e-4), np.log(1e-2))))
        passivity = world.set("device.damping", damping).check(remedies=False).passivity
        required = passivity["required_damping"]
        assert required is None or passivity["passive"] == (damping >= required)
        if required and abs(damping / required - 1) < 0.02:
            near += 1
            continue
        looked += 1
        verdicts[passivity["passive"]] += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs = bool(control.ispassive(positive_real(world, damping)))
        if theirs != passivity["passive"]:
            wrong.append((method, damping, required))
    assert not wrong
    assert min(verdicts.values()) >= 50 and near < 30, "with only one verdict, or a margin that leaves out much, the test would prove little"
