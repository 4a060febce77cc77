"""The Python package beside the crates and beside other tools: `cargo xtask bench python`.

Arguments: hapt-bench, hapt, rounds. In each round everything is timed once, in turns. Prints Markdown.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import hapt
import numpy as np

BENCH, HAPT, ROUNDS = sys.argv[1], sys.argv[2], int(sys.argv[3])


def timed(call):
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def in_turns(calls):
    """Each call's times in s, and its last result."""
    times, results = {name: [] for name in calls}, {}
    for _ in range(ROUNDS):
        for name, call in calls.items():
            spent, results[name] = call()
            times[name].append(spent)
    return times, results


def quartiles(values):
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    return f"{middle:.2f} ({low:.2f} to {high:.2f})", middle


def goal(value, most):
    return f"{most} | {'met' if value <= most else '**missed**'}"


def rust(words):
    """Seconds of a sample, as hapt-bench times it."""
    text = subprocess.run([BENCH, *words.split()], check=True, capture_output=True, text=True).stdout
    return 1e-9 * float(text.split()[1]), None


# The package beside the crates.

wheel = hapt.load("@notes/wheel")
SAMPLES = 10_001
STEPS = 200_000


def median_of(pieces, call):
    """Seconds of a call: the median of short pieces, as hapt-bench takes it, so that what else runs here counts little."""
    return statistics.median(timed(call)[0] for _ in range(pieces)), None


def steps():
    step = wheel.loop().step

    def piece():
        for _ in range(1000):
            step(0.5, 0.0)

    spent, _ = median_of(STEPS // 1000, piece)
    return spent / 1000, None


def run_of_rust():
    spent, _ = rust("run held everything 20")
    return spent * SAMPLES, None


AXES = {"couplings.0.stiffness": np.linspace(0.5, 2.0, 1000), "bodies.wheel.inertia": np.linspace(0.01, 0.05, 1000)}
VARY = [f"--vary={key}={values[0]}..{values[-1]}:{len(values)}" for key, values in AXES.items()]


def sweep_of_command():
    with tempfile.TemporaryDirectory() as folder:
        command = [HAPT, "sweep", "@notes/euler", *VARY, "--measure=held_growth_per_s", f"--out={folder}/t.parquet"]
        return timed(lambda: subprocess.run(command, check=True, capture_output=True))


euler = hapt.load("@notes/euler")
sweeps = {
    "sweep, command": sweep_of_command,
    "sweep": lambda: timed(lambda: euler.sweep(AXES, "held_growth_per_s", progress=False)),
}
if not Path(HAPT).exists():
    sweeps = {}
times, results = in_turns(
    {
        "step, core": lambda: rust(f"step 1 {STEPS}"),
        "step": steps,
        "run, crates": run_of_rust,
        "run": lambda: median_of(20, wheel.simulate),
        **sweeps,
    }
)
print("### The package beside the crates\n")
load = f"; {os.getloadavg()[0]:.0f} processes wanted to run on {os.cpu_count()} cores meanwhile" if hasattr(os, "getloadavg") else ""
print(f"In turns, {ROUNDS} rounds{load}: only the ratios mean something. `Loop.step` of one body; the run of 10 s with all columns as arrays, in Python with the summary; a sweep of 10⁶ held loops beside the whole command with its file.\n")
print("| | package | crates | | goal | |\n| --- | --- | --- | --- | --- | --- |")
over = 1e6 * np.subtract(times["step"], times["step, core"])
text, middle = quartiles(over)
print(f"| step, µs | {1e6 * statistics.median(times['step']):.3f} | {1e6 * statistics.median(times['step, core']):.3f} | {text} more | {goal(middle, 0.3)} |")
rows = [("run", "run, crates", 1.3), ("sweep", "sweep, command", 1.0)]
for name, other, most in [row for row in rows if row[0] in times]:
    text, middle = quartiles(np.divide(times[name], times[other]))
    here, there = (1e3 * statistics.median(times[key]) for key in (name, other))
    print(f"| {name}, ms | {here:.2f} | {there:.2f} | {text} times | {goal(middle, most)} |")
if not sweeps:
    print("\nThe command `hapt` was not built here, so there is no sweep beside it.")

# Beside other tools.

k, j = wheel.get("couplings.0.stiffness"), wheel.get("bodies.wheel.inertia")
z0, period = np.pi / 4, 1e-3
grid = np.arange(SAMPLES) * period
exact = z0 * (1 - np.cos(np.sqrt(k / j) * grid))
tools, absent = {f"hapt {hapt.__version__}, simulate": lambda: wheel.simulate()["wheel_rad"]}, []


def tool(make):
    """A tool's run, named by its documentation; left out where it is not installed."""
    try:
        name, call = make()
        tools[name] = call
    except ImportError as error:
        absent.append(error.name or str(error))


@tool
def python_control():
    import control

    system = control.ss([[0, 1], [-k / j, 0]], [[0], [k / j]], [[1, 0]], [[0]])
    push = np.full(SAMPLES, z0)
    return f"python-control {version('control')}, forced_response", lambda: control.forced_response(system, grid, push).outputs


@tool
def scipy():
    from scipy.integrate import solve_ivp

    def swing():
        rate = lambda _, x: (x[1], k / j * (z0 - x[0]))  # noqa: E731
        return solve_ivp(rate, (0, grid[-1]), (0.0, 0.0), "DOP853", t_eval=grid, rtol=1e-10, atol=1e-12).y[0]

    return f"SciPy {version('scipy')}, solve_ivp, DOP853 at 1e-10", swing


@tool
def pathsim():
    from pathsim import Connection, Simulation
    from pathsim.blocks import Adder, Amplifier, Constant, Integrator, Scope

    def swing():
        push, spring, speed, place, scope = Constant(z0), Amplifier(k / j), Integrator(0.0), Integrator(0.0), Scope()
        stretch = Adder("+-")
        wires = [
            Connection(push, stretch[0]),
            Connection(place, stretch[1], scope),
            Connection(stretch, spring),
            Connection(spring, speed),
            Connection(speed, place),
        ]
        simulation = Simulation([push, stretch, spring, speed, place, scope], wires, dt=period, log=False)
        simulation.run(grid[-1])
        rows = scope.read()[1][0]
        return np.concatenate([rows[: SAMPLES - 1], rows[-1:]])

    return f"pathsim {version('pathsim')}, its default solver at 1 ms", swing


@tool
def mujoco():
    import mujoco

    model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{period}" gravity="0 0 0" integrator="RK4"/>
  <worldbody><body>
    <joint type="hinge" axis="0 0 1" stiffness="{k}" springref="{z0}"/>
    <inertial pos="0 0 0" mass="1" diaginertia="{j} {j} {j}"/>
  </body></worldbody>
</mujoco>""")

    def swing():
        data, rows = mujoco.MjData(model), np.empty(SAMPLES)
        for i in range(SAMPLES):
            rows[i] = data.qpos[0]
            mujoco.mj_step(model, data)
        return rows

    return f"MuJoCo {version('mujoco')}, RK4 at 1 ms", swing


@tool
def drake():
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import ConstantVectorSource, LinearSystem, LogVectorOutput

    def swing():
        builder = DiagramBuilder()
        plant = builder.AddSystem(LinearSystem([[0, 1], [-k / j, 0]], [[0], [k / j]], [[1, 0]], [[0]], 0.0))
        builder.Connect(builder.AddSystem(ConstantVectorSource([z0])).get_output_port(), plant.get_input_port())
        log = LogVectorOutput(plant.get_output_port(), builder, period)
        simulator = Simulator(builder.Build())
        simulator.get_mutable_integrator().set_target_accuracy(1e-10)
        simulator.AdvanceTo(grid[-1])
        return log.FindLog(simulator.get_context()).data()[0]

    return f"Drake {version('drake')}, its default integrator at 1e-10", swing


times, results = in_turns({name: (lambda call=call: timed(call)) for name, call in tools.items()})
print("\n### Beside other tools\n")
print(
    "The virtual wheel under a held step of 45° for 10 s, 10 001 rows; the error is the largest against z0 (1 - cos ωt). hapt runs the sampled loop on"
    " its device with all columns; the others solve the wheel's equation alone.\n"
)
print("| | ms | times hapt's | largest error, rad |\n| --- | --- | --- | --- |")
first = next(iter(times))
for name, spent in times.items():
    rows = np.ravel(results[name])
    error = abs(rows - exact[: len(rows)]).max() if len(rows) == SAMPLES else float("nan")
    print(f"| {name} | {1e3 * statistics.median(spent):.2f} | {quartiles(np.divide(spent, times[first]))[0]} | {error:.0e} |")
if absent:
    print(f"\nNot installed here: {', '.join(absent)}.")
