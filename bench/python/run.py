"""The released wheel of `cargo xtask bench` in Python: `name|milliseconds of a run|last w|last z`, for what can be imported.

Arguments: T, samples, J_z, b, limit, J_w, k, z0, the sample of the release.
"""

import statistics
import sys
import time
from importlib.metadata import version
from math import cos, exp, sin, sqrt

import numpy as np

T, samples, J, b, limit, J_w, k, z0, release = map(float, sys.argv[1:])
samples, release = int(samples), int(release)


def timed(name, repeats, run):
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        rows = run()
        times.append(1e3 * (time.perf_counter() - start))
    print(f"{name}|{statistics.median(times)}|{float(rows[-1][0])}|{float(rows[-1][2])}", flush=True)


omega, a = sqrt(k / J_w), b / J
W = np.array([[cos(omega * T), sin(omega * T) / omega], [-omega * sin(omega * T), cos(omega * T)]])
Z = np.array([[1, (1 - exp(-a * T)) / a], [0, exp(-a * T)]])
F = np.array([(T - (1 - exp(-a * T)) / a) / b, (1 - exp(-a * T)) / b])


def hybrid(puck_after):
    """Rows of w, w', z, z', torque; `puck_after(z, torque)` is the puck a period later."""
    rows = np.empty((samples, 5))
    w, z, torque = np.zeros(2), np.array([z0, 0.0]), 0.0
    for i in range(samples):
        if i > release:
            z = puck_after(z, torque)
        held = np.array([z[0], 0.0])
        after = held + W @ (w - held)
        torque = min(max(k * (after[0] - z[0]), -limit), limit)
        rows[i, :2], rows[i, 2:4], rows[i, 4] = w, z, torque
        w = after
    return rows


timed(f"NumPy {version('numpy')}, a loop over the samples", 5, lambda: hybrid(lambda z, torque: Z @ z + F * torque))

try:
    import control

    # The limit is never reached: released, the whole loop is one matrix on (w, w', z, z').
    held = np.zeros((4, 4))
    held[:2, :2], held[:2, 2], held[2, 2] = W, (np.eye(2) - W)[:, 0], 1
    free = held.copy()
    free[2:, 2:] = Z
    free[2:, :] += np.outer(F, k * (held[0] - [0, 0, 1, 0]))

    def response(A, x, n):
        system = control.ss(A, np.zeros((4, 1)), np.eye(4), np.zeros((4, 1)), T)
        return control.forced_response(system, np.arange(n) * T, np.zeros(n), x).outputs.T

    def linear():
        first = response(held, [0, 0, z0, 0], release + 1)
        return np.vstack([first[:-1], response(free, first[-1], samples - release)])

    timed(f"python-control {version('control')}, forced_response", 5, linear)
except ImportError:
    pass

try:
    from scipy.integrate import solve_ivp

    def solved(z, torque):
        return solve_ivp(lambda _, y: (y[1], (torque - b * y[1]) / J), (0, T), z, rtol=1e-9, atol=1e-12).y[:, -1]

    timed(f"SciPy {version('scipy')}, solve_ivp from sample to sample", 3, lambda: hybrid(solved))
except ImportError:
    pass
