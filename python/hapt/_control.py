"""World, device and loop as state spaces of python-control."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ._world import World

Matrix = NDArray[np.float64]

#: A delay that differs from a whole number of samples by less than this part of a period counts as that number.
_WHOLE = 1e-6


class StateSpaces(NamedTuple):
    """The result of `World.to_control`; each field is a `control.StateSpace`. Torques in N·m, positions in rad (linear: N, m).

    `world` is discrete: from the measured position and velocity to the torque on the puck. `device` is continuous: from the motor's command
    to the puck's position and velocity, with the motor's lag and the handle's shaft where the world has them, without delay and Coulomb
    friction. `loop` is discrete: world, device, estimator, hold and delay, from a hand's torque (on the handle where there is one), held for a
    period, to the puck's position and velocity. Encoder, levels and limit are left out; nonlinear couplings have their steepest slope.
    """

    world: Any
    device: Any
    loop: Any


def state_spaces(world: World) -> StateSpaces:
    """The state spaces of `World.to_control`. Raises ImportError without python-control, ValueError where the analysis has no result."""
    import control

    parts = json.loads(world._native.state_spaces())
    period = float(parts["period"])
    a, b, c, d = _matrices(parts["world"])
    names = {"inputs": ["position", "velocity"], "outputs": ["torque"], "name": "world"}
    discrete = control.ss(a, b, c, d, period, **names)
    ad, bd, cd, dd = _matrices(parts["device"])
    names = {"inputs": ["torque"], "outputs": ["position", "velocity"], "name": "device"}
    continuous = control.ss(ad, bd[:, :1], cd, dd[:, :1], **names)
    # FOAW has a filter for each length of its window; this is the longest.
    estimator = _filtered(_estimator(parts["estimators"][-1], period), parts["filter"])
    names = {"inputs": ["hand_torque"], "outputs": ["position", "velocity"], "name": "loop"}
    closed = _closed((a, b, c, d), estimator, _sampled(ad, bd, period, float(parts["delay"])))
    return StateSpaces(discrete, continuous, control.ss(*closed, period, **names))


def _matrices(part: dict[str, Any]) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    d = np.array(part["d"], dtype=float)
    outputs, inputs = d.shape
    order = len(part["a"])
    a = np.array(part["a"], dtype=float).reshape(order, order)
    b = np.array(part["b"], dtype=float).reshape(order, inputs)
    return a, b, np.array(part["c"], dtype=float).reshape(outputs, order), d


def _estimator(part: dict[str, Any], period: float) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """The filter from (z_k, ż_k) to (z_k, v_k): v_k = pole v_{k-1} + Σ taps_i z_{k-i}. Its state is v_{k-1} and the earlier positions; of a
    Kalman filter its position, velocity and acceleration."""
    if part["kalman"] is not None:
        predict = np.array([[1.0, period, period**2 / 2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
        gain = np.array(part["kalman"], dtype=float) / np.array([1.0, period, period**2])
        a = predict - gain[:, None] @ predict[:1]
        b = np.zeros((3, 2))
        b[:, 0] = gain
        return a, b, np.vstack([np.zeros(3), a[1]]), np.array([[1.0, 0.0], [gain[1], 0.0]])
    taps, pole = np.array(part["taps"], dtype=float), float(part["pole"])
    if not len(taps):
        return np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), np.eye(2)
    order = len(taps)
    velocity = np.concatenate([[pole], taps[1:]])
    a = np.zeros((order, order))
    a[0] = velocity
    a[2:, 1:-1] = np.eye(order - 2)
    b = np.zeros((order, 2))
    b[0, 0] = taps[0]
    b[1, 0] = 1.0
    return a, b, np.vstack([np.zeros(order), velocity]), np.array([[1.0, 0.0], [taps[0], 0.0]])


def _filtered(estimator: tuple[Matrix, Matrix, Matrix, Matrix], pole: float | None) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """The estimator with y_k = pole y_{k-1} + (1 - pole) z_k in place of z_k, where the position is filtered; the last state is y_{k-1}."""
    if pole is None:
        return estimator
    a, b, c, d = estimator
    order = len(a)
    own = np.array([[1.0 - pole, 0.0]])
    return (
        np.block([[a, np.zeros((order, 1))], [np.zeros((1, order)), np.array([[pole]])]]),
        np.vstack([b, own]),
        np.hstack([c, np.array([[pole], [0.0]])]),
        np.vstack([own, d[1:]]),
    )


def _sampled(a: Matrix, b: Matrix, period: float, delay: float) -> tuple[Matrix, Matrix]:
    """The device sampled once a period: the matrices a and b of its state and the delayed commands; inputs: this command, a hand's torque.

    With a delay of n samples and a part of one, the motor holds the command of n + 1 samples ago for that part, then that of n samples ago.
    """
    from scipy.linalg import expm

    states = len(a)

    def over(h: float) -> tuple[Matrix, Matrix, Matrix]:
        """The transition of the state over the time `h`, and its response to a command and to a hand's torque held over it."""
        whole = np.asarray(expm(h * np.block([[a, b], [np.zeros((2, states + 2))]])), dtype=np.float64)
        return whole[:states, :states], whole[:states, states : states + 1], whole[:states, states + 1 : states + 2]

    samples = delay / period
    n = int(np.floor(samples + _WHOLE))
    part = max(samples - n, 0.0) if samples - n > _WHOLE else 0.0
    change, new, _ = over((1 - part) * period)
    old = change @ over(part * period)[1]
    flying = n + (part > 0)
    order = states + flying
    out_a, out_b = np.zeros((order, order)), np.zeros((order, 2))
    out_a[:states, :states], _, out_b[:states, 1:] = over(period)
    for age, push in ((n, new), (n + 1, old)):
        if age == 0:
            out_b[:states, :1] += push
        elif age <= flying:
            out_a[:states, states + age - 1 : states + age] += push
    if flying:
        out_b[states, 0] = 1.0
        out_a[states + 1 :, states:-1] = np.eye(flying - 1)
    return out_a, out_b


def _closed(
    world: tuple[Matrix, Matrix, Matrix, Matrix],
    estimator: tuple[Matrix, Matrix, Matrix, Matrix],
    device: tuple[Matrix, Matrix],
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """The closed loop: its state is the device's, then the estimator's, then the world's."""
    aw, bw, cw, dw = world
    ae, be, ce, de = estimator
    ad, bd = device
    nd, ne, nw = len(ad), len(ae), len(aw)
    seen = np.hstack([np.eye(2, nd), np.zeros((2, ne + nw))])
    estimated = de @ seen + np.hstack([np.zeros((2, nd)), ce, np.zeros((2, nw))])
    torque = dw @ estimated + np.hstack([np.zeros((1, nd + ne)), cw])
    zeros = np.zeros
    a = np.vstack(
        [
            np.hstack([ad, zeros((nd, ne + nw))]) + bd[:, :1] @ torque,
            np.hstack([zeros((ne, nd)), ae, zeros((ne, nw))]) + be @ seen,
            np.hstack([zeros((nw, nd + ne)), aw]) + bw @ estimated,
        ]
    )
    return a, np.vstack([bd[:, 1:], zeros((ne + nw, 1))]), seen, np.zeros((2, 1))
