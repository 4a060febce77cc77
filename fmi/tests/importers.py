"""Importers check the FMUs that hapt exports: python importers.py HAPT FOLDER.

FMPy validates and simulates both versions against `hapt sim` and against stored results; libcosim runs two FMUs that drive each other; pathsim-fmi runs one.
"""

import csv
import functools
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.util import read_csv, read_ref_opt_file
from fmpy.validation import validate_fmu
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

HAPT, FOLDER = Path(sys.argv[1]), Path(sys.argv[2])
WORLDS = sorted(Path("worlds").glob("*/*.toml"))

# Of a push, in periods: half a second of most worlds.
ROWS = 500
# A hand's torque for half of the time, then none: a held input can represent it exactly.
PUSH = """
[scenarios.pushed]
duration = "{} ms"
hand = {{ kind = "torque", moves = {{ kind = "step", to = 0.05 }}, release = "{} ms" }}
"""
SLIDER = """
title = "A slider"
motion = "linear"
loop = { period = "0.5 ms", delay = "0.2 ms", estimator = "low-pass", cutoff = "200 Hz" }
device = { inertia = "50 g", damping = "0.5 N s/m", friction = "0.1 N", limit = "4 N", encoder = "2 um", levels = 4096 }
bodies.mass = { inertia = "0.1 kg", position = "1 mm" }
[[couplings]]
kind = "spring"
between = ["puck", "mass"]
stiffness = "300 N/m"
"""


def hapt(*arguments):
    subprocess.run([HAPT, *map(str, arguments)], check=True, capture_output=True, text=True)


def exported(world, name, fmi, *flags):
    fmu = FOLDER / f"{name}-{fmi}{''.join(flags)}.fmu"
    hapt("export", "fmu", world, "-o", fmu, "--fmi", fmi, *flags)
    assert (problems := validate_fmu(str(fmu))) == [], (fmu, problems)
    return str(fmu)


def with_push(text):
    """A world's text with the scenario `pushed`."""
    period = float(re.search(r'^(?:loop = { )?period *= *"([\d.]+) ms"', text, re.MULTILINE)[1])
    return text + PUSH.format(ROWS * period, ROWS * period / 2)


@functools.cache
def ran(world, scenario, *flags):
    # One folder for the runs of all worlds: each replaces the file of the world before.
    hapt("sim", world, "--scenario", scenario, "--out", FOLDER, "--force", *flags)
    with open(FOLDER / f"{scenario}.csv") as file:
        names = next(csv.reader(file))
        table = np.array([[float(field) for field in row] for row in csv.reader(file)])
    return dict(zip(names, table.T))


def simulated(world, scenario, *flags):
    """The columns of a run by their names."""
    return dict(ran(world, scenario, *flags))


class Slave:
    """An instance in FMPy, by either version, and its variables by name."""

    def __init__(self, fmu):
        self.description = fmpy.read_model_description(fmu)
        kind = FMU2Slave if self.description.fmiVersion == "2.0" else FMU3Slave
        self.guid = self.description.guid or self.description.instantiationToken
        self.folder = fmpy.extract(fmu)
        self.fmu = kind(
            guid=self.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.fmu.instantiate()
        if kind is FMU2Slave:
            self.fmu.setupExperiment(startTime=0.0)
            self.fmu.enterInitializationMode()
            self.get, self.set = self.fmu.getReal, self.fmu.setReal
        else:
            self.fmu.enterInitializationMode(startTime=0.0)
            self.get, self.set = self.fmu.getFloat64, self.fmu.setFloat64

    def read(self, names):
        return self.get([self.references[name] for name in names])

    def write(self, name, value):
        self.set([self.references[name]], [value])

    def step(self, at, length):
        self.fmu.doStep(currentCommunicationPoint=at, communicationStepSize=length)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


def referenced(world):
    """An importer's own simulation, with the input and the options that are stored next to the world, gives the stored results."""
    sibling = lambda ending: str(world.with_name(world.stem + ending))  # noqa: E731
    options, given, stored = read_ref_opt_file(sibling("_ref.opt")), read_csv(sibling("_in.csv")), read_csv(sibling("_ref.csv"))
    for fmi in (2, 3):
        result = fmpy.simulate_fmu(
            exported(world, f"reference-{world.stem}", fmi, "--whole"),
            start_time=options["StartTime"],
            stop_time=options["StopTime"],
            step_size=options["StepSize"],
            output_interval=options["OutputInterval"],
            input=given,
        )
        assert len(result) == len(stored) > 2, (world, len(result), len(stored))
        for name in stored.dtype.names:
            most = options["RelTol"] * max(1.0, np.max(np.abs(stored[name])))
            assert np.max(np.abs(result[name] - stored[name])) <= most, (world, fmi, name)


def signal(times, columns):
    table = np.zeros(len(times), dtype=[("time", float), *((name, float) for name in columns)])
    table["time"] = times
    for name, values in columns.items():
        table[name] = values
    return table


def whole(world, name, fmi):
    """The loop on its device: FMPy's own simulation to 1e-12 of the run, and its calls one by one to the bit."""
    fmu = exported(world, name, fmi, "--whole")
    run = simulated(world, "pushed")
    times, columns = run.pop("time_s"), list(run)
    period, end = times[1], times[-1]
    hand = "hand_force_N" if "puck_m" in run else "hand_torque_Nm"
    pushed = signal([0.0, end / 2, end / 2, end], {hand: [0.05, 0.05, 0.0, 0.0]})
    result = fmpy.simulate_fmu(fmu, stop_time=end, step_size=period, output_interval=period, input=pushed)
    assert len(result) == len(times), (name, len(result), len(times))
    for column in columns:
        assert np.max(np.abs(result[column] - run[column])) <= 1e-12 * max(1.0, np.max(np.abs(run[column]))), (name, column)
    slave = Slave(fmu)
    slave.fmu.exitInitializationMode()
    for k, at in enumerate(times):
        assert slave.read(columns) == [run[column][k] for column in columns], (name, fmi, k)
        slave.write(hand, 0.05 if at < end / 2 - 1e-9 else 0.0)
        slave.step(at, period)
    slave.close()


def loop_fed(world, scenario, name, fmi):
    """The loop without its device on a run's puck: the outputs of the step that begins with a sample are that sample's."""
    fmu = exported(world, name, fmi)
    run = simulated(world, scenario)
    times = run.pop("time_s")[: ROWS + 1]
    period = times[1]
    inputs = {column: values[: len(times)] for column, values in run.items() if column.startswith("puck_")}
    columns = [column for column in run if column not in inputs and not column.startswith("applied_")]
    result = fmpy.simulate_fmu(
        fmu, stop_time=times[-1], step_size=period, output_interval=period, input=signal(times, inputs), output=columns
    )
    for column in columns:
        expected = run[column][: len(times) - 1]
        assert np.max(np.abs(result[column][1 : len(times)] - expected)) <= 1e-12 * max(1.0, np.max(np.abs(expected))), (name, column)
    slave = Slave(fmu)
    slave.fmu.exitInitializationMode()
    for k, at in enumerate(times):
        for column, values in inputs.items():
            slave.write(column, values[k])
        slave.step(at, period)
        assert slave.read(columns) == [run[column][k] for column in columns], (name, fmi, k)
    slave.close()


def changed(world):
    """Parameters that FMPy sets at the start are overrides of the world file."""
    values = {"couplings.0.stiffness": 0.5, "bodies.wheel.inertia": 0.02, "loop.method": "trapezoidal", "loop.period": 2e-3}
    sets = [argument for name, value in values.items() for argument in ("--set", f"{name}={value}")]
    run = simulated(world, "pushed", *sets)
    end = run["time_s"][-1]
    pushed = signal([0.0, end / 2, end / 2, end], {"hand_torque_Nm": [0.05, 0.05, 0.0, 0.0]})
    for fmi in (2, 3):
        fmu = exported(world, "changed", fmi, "--whole")
        result = fmpy.simulate_fmu(
            fmu, stop_time=end, step_size=2e-3, output_interval=2e-3, input=pushed, start_values=values
        )
        for column in ("puck_rad", "wheel_rad", "torque_Nm"):
            assert np.max(np.abs(result[column] - run[column])) <= 1e-12, (fmi, column)


def coupled(world):
    """A wheel on its device turns the puck of a second loop, whose torque is the hand of the first: libcosim, and FMPy step by step."""
    fmus = [exported(world, "coupled-device", 2, "--whole"), exported(world, "coupled-loop", 2)]
    wires = [(0, "puck_rad", 1, "puck_rad"), (0, "puck_rad_per_s", 1, "puck_rad_per_s"), (1, "torque_Nm", 0, "hand_torque_Nm")]
    shown = [(0, "puck_rad"), (0, "wheel_rad"), (1, "torque_Nm"), (1, "wheel_rad")]
    steps, initial = 2000, {"bodies.wheel.position": 0.3}

    slaves = [Slave(fmu) for fmu in fmus]
    for name, value in initial.items():
        slaves[1].write(name, value)

    def pass_on():
        # All outputs before the first input: an output that is read after an input is set shows it already.
        values = [slaves[a].read([name])[0] for a, name, _, _ in wires]
        for value, (_, _, b, other) in zip(values, wires):
            slaves[b].write(other, value)

    pass_on()
    pass_on()
    for slave in slaves:
        slave.fmu.exitInitializationMode()
    expected = []
    for k in range(steps):
        pass_on()
        for slave in slaves:
            slave.step(k * 1e-3, 1e-3)
        expected.append([slaves[index].read([name])[0] for index, name in shown])

    execution = CosimExecution.from_step_size(1_000_000)
    local = [CosimLocalSlave(fmu_path=fmu, instance_name=f"slave{i}") for i, fmu in enumerate(fmus)]
    index = [execution.add_local_slave(slave) for slave in local]
    for a, name, b, other in wires:
        ends = index[a], slaves[a].references[name], index[b], slaves[b].references[other]
        assert execution.connect_real_variables(*ends) == 0
    for name, value in initial.items():
        assert execution.real_initial_value(index[1], slaves[1].references[name], value)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    differ = 0.0
    for k in range(steps):
        assert execution.step()
        values = [observer.last_real_values(index[i], [slaves[i].references[name]])[0] for i, name in shown]
        differ = max(differ, *(abs(a - b) for a, b in zip(values, expected[k])))
    assert differ <= 1e-12, differ
    assert np.ptp([row[0] for row in expected]) > 1e-3, "nothing moved"
    for slave in slaves:
        slave.close()


def scheduled(world):
    """pathsim runs the loop on its device under a constant torque: its steps are the run's rows."""
    from pathsim import Connection, Simulation
    from pathsim.blocks import Constant
    from pathsim_fmi import CoSimulationFMU

    # While the hand pushes.
    held = ROWS // 2 - 10
    for fmi in (2, 3):
        run = simulated(world, "pushed")
        block = CoSimulationFMU(exported(world, "scheduled", fmi, "--whole"), dt=1e-3)
        source = Constant(0.05)
        seen, step = [], block._step_fmu

        def recorded(at):
            step(at)
            seen.append(np.array(block.outputs.to_array()))

        block.events[0].func_act = recorded
        simulation = Simulation([source, block], [Connection(source, block)], dt=1e-3, log=False)
        simulation.run(held * 1e-3)
        rows = np.array([run[column][1 : len(seen) + 1] for column in run if column != "time_s"]).T
        assert len(seen) >= held - 1 and np.max(np.abs(np.array(seen) - rows)) <= 1e-12


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    slider = FOLDER / "slider.toml"
    slider.write_text(with_push(SLIDER))
    pushed = [(slider, "slider")]
    for file in WORLDS:
        for extra in file.parent.glob("*.csv"):
            shutil.copy(extra, FOLDER)
        world = FOLDER / file.name
        world.write_text(with_push(file.read_text()))
        pushed.append((world, file.stem))
    for world, name in pushed:
        for fmi in (2, 3):
            whole(world, name, fmi)
    for file in WORLDS:
        scenario = file.read_text().split("[scenarios.")[1].split("]")[0]
        for fmi in (2, 3):
            loop_fed(file, scenario, file.stem, fmi)
    for file in sorted(Path("fmi/reference").glob("*.toml")):
        referenced(file)
    wheel = FOLDER / "default.toml"
    changed(wheel)
    coupled(wheel)
    scheduled(wheel)
    versions = ", ".join(f"{name} {version(name)}" for name in ("fmpy", "libcosimpy", "pathsim", "pathsim-fmi"))
    print(f"{len(pushed)} worlds in both versions: {versions}")


main()
