"""A sweep of released wheels by what users of Python would pick instead: `cargo xtask bench python`.

The work of bench/c/sweep.c: the notes' wheel for a second at 1 kHz, stepped to 45 degrees and let go after 0.25 s, on its device, for every
pair of a stiffness and an inertia; the largest torque and the energy at the end. Argument: rounds. Prints Markdown.
"""

import os
import statistics
import sys
import time
from importlib.metadata import version

# Two devices, so that JAX uses both cores for one batch. It reads this when it is imported.
os.environ["XLA_FLAGS"] = "--xla_force_host_platform_device_count=2"

import hapt
import numpy as np

ROUNDS = int(sys.argv[1])
THREADS, SIDE = 2, 16
STIFFNESS, INERTIA = np.linspace(0.5, 2.0, 250), np.linspace(0.01, 0.05, 400)
SAMPLES, RELEASE = 1001, 250
WHEEL = hapt.load("@notes/default").set("scenarios.step.duration", "1 s").set("scenarios.step.hand.release", "0.25 s")
T, J, B, LIMIT, TO = (
    WHEEL.get(key)
    for key in ("loop.period", "device.inertia", "device.damping", "device.limit", "scenarios.step.hand.to")
)
K, BODY = (values.ravel() for values in np.meshgrid(STIFFNESS, INERTIA, indexing="ij"))

DECAY = np.expm1(-B / J * T)
DV_V, DV_F, DZ_V, DZ_F = DECAY, -DECAY / B, -DECAY * J / B, (T + DECAY * J / B) / B

tools, few, absent = {}, {}, []


def tool(make):
    """A tool's sweep, by its name; left out where it is not installed."""
    try:
        name, worlds, call = make()
        tools[name] = call
        few[name] = worlds
    except ImportError as error:
        absent.append(error.name or str(error))


@tool
def package():
    axes = {"couplings.0.stiffness": STIFFNESS, "bodies.wheel.inertia": INERTIA}
    names = ["peak_torque", "final_energy"]

    def sweep():
        table = WHEEL.sweep(axes, names, progress=False, threads=THREADS)
        return [table[name].ravel() for name in names]

    return f"hapt {hapt.__version__}", K.size, sweep


@tool
def numba():
    import numba

    numba.set_num_threads(THREADS)

    @numba.njit(parallel=True, fastmath={"nnan", "ninf", "nsz", "arcp"})
    def sweep(stiffness, inertia, peak, energy):
        for block in numba.prange(stiffness.size // SIDE):
            k, j = stiffness[block * SIDE : (block + 1) * SIDE], inertia[block * SIDE : (block + 1) * SIDE]
            omega = np.sqrt(k / j)
            c1, c2, c3 = -2 * np.sin(0.5 * omega * T) ** 2, np.sin(omega * T) / omega, -np.sin(omega * T) * omega
            z, v, most, held = np.full(SIDE, TO), np.zeros(SIDE), np.zeros(SIDE), np.zeros(SIDE)
            w, u, dw, du = np.zeros(SIDE), np.zeros(SIDE), np.zeros(SIDE), np.zeros(SIDE)
            for n in range(SAMPLES):
                moves = 1.0 if n > RELEASE else 0.0
                for i in range(SIDE):
                    z[i] += moves * (DZ_V * v[i] + DZ_F * held[i])
                    v[i] += moves * (DV_V * v[i] + DV_F * held[i])
                    w[i] += dw[i]
                    u[i] += du[i]
                    dw[i] = c1[i] * (w[i] - z[i]) + c2[i] * u[i]
                    du[i] = c3[i] * (w[i] - z[i]) + c1[i] * u[i]
                    torque = k[i] * (w[i] + dw[i] - z[i])
                    most[i] = max(most[i], abs(torque))
                    held[i] = min(max(torque, -LIMIT), LIMIT)
            for i in range(SIDE):
                peak[block * SIDE + i] = most[i]
                energy[block * SIDE + i] = 0.5 * j[i] * u[i] ** 2 + 0.5 * k[i] * (z[i] - w[i]) ** 2

    def run():
        peak, energy = np.empty(K.size), np.empty(K.size)
        sweep(K, BODY, peak, energy)
        return [peak, energy]

    return f"numba {numba.__version__}, sixteen worlds a block, two threads", K.size, run


@tool
def jax():
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    piece = 500  # Worlds whose numbers stay in the cache.
    mesh = jax.sharding.Mesh(np.array(jax.devices()), ("worlds",))
    shared = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("worlds"))
    k, j = (jax.device_put(x.reshape(THREADS, -1, piece), shared) for x in (K, BODY))

    def of_piece(k_and_j):
        k, j = k_and_j
        omega = jnp.sqrt(k / j)
        c1, c2, c3 = -2 * jnp.sin(0.5 * omega * T) ** 2, jnp.sin(omega * T) / omega, -jnp.sin(omega * T) * omega

        def sample(moves):
            def take(_, x):
                z, v, w, u, dw, du, held, most = x
                if moves:
                    z, v = z + DZ_V * v + DZ_F * held, v + DV_V * v + DV_F * held
                w, u = w + dw, u + du
                dw, du = c1 * (w - z) + c2 * u, c3 * (w - z) + c1 * u
                torque = k * (w + dw - z)
                return z, v, w, u, dw, du, jnp.clip(torque, -LIMIT, LIMIT), jnp.maximum(most, jnp.abs(torque))

            return take

        nothing = jnp.zeros_like(k)
        x = jax.lax.fori_loop(0, RELEASE + 1, sample(False), (nothing + TO, *[nothing] * 7), unroll=4)
        z, _, w, u, *_, most = jax.lax.fori_loop(RELEASE + 1, SAMPLES, sample(True), x, unroll=4)
        return most, 0.5 * j * u**2 + 0.5 * k * (z - w) ** 2

    of_device = jax.shard_map(
        lambda k, j: tuple(x[None] for x in jax.lax.map(of_piece, (k[0], j[0]))),
        mesh=mesh,
        in_specs=jax.sharding.PartitionSpec("worlds"),
        out_specs=jax.sharding.PartitionSpec("worlds"),
    )
    sweep = jax.jit(of_device)
    return f"JAX {jax.__version__} on the processor, two devices", K.size, lambda: [np.ravel(x) for x in sweep(k, j)]


@tool
def mujoco():
    import mujoco
    from mujoco import rollout

    some = np.linspace(0, K.size - 1, 64).astype(int)

    def model(k, j):
        # The wheel hangs on the puck by its spring, and nothing samples it.
        return mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{T}" gravity="0 0 0" integrator="RK4"/>
  <worldbody>
    <body><joint name="z" type="hinge" axis="0 0 1" damping="{B}"/><inertial pos="0 0 0" mass="1" diaginertia="{J} {J} {J}"/></body>
    <body><joint name="w" type="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="{j} {j} {j}"/></body>
  </worldbody>
  <tendon><fixed stiffness="{k}"><joint joint="z" coef="-1"/><joint joint="w" coef="1"/></fixed></tendon>
</mujoco>""")

    models = [model(k, j) for k, j in zip(K[some], BODY[some])]
    data = [mujoco.MjData(models[0]) for _ in range(THREADS)]
    states = np.empty((len(models), mujoco.mj_stateSize(models[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    for i, one in enumerate(models):
        at = mujoco.MjData(one)
        at.qpos[0] = TO
        mujoco.mj_getState(one, at, states[i], mujoco.mjtState.mjSTATE_FULLPHYSICS)

    def run():
        rollout.rollout(models, data, states, nstep=SAMPLES)

    return f"MuJoCo {version('mujoco')}, rollout, RK4 at 1 ms, two threads; the mechanics alone", len(some), run


@tool
def pathsim():
    from pathsim import Connection, Simulation
    from pathsim.blocks import Adder, Amplifier, Integrator, Scope

    def run():
        spring, drag, scope = Amplifier(1.0), Amplifier(-B / J), Scope()
        stretch, force = Adder("+-"), Adder("++")
        push, pull = Amplifier(1 / J), Amplifier(-1 / 0.0258)
        speeds, places = [Integrator(0.0), Integrator(0.0)], [Integrator(TO), Integrator(0.0)]
        wires = [
            Connection(places[1], stretch[0]),
            Connection(places[0], stretch[1], scope),
            Connection(stretch, spring),
            Connection(spring, push, pull),
            Connection(push, force[0]),
            Connection(drag, force[1]),
            Connection(force, speeds[0]),
            Connection(speeds[0], drag, places[0]),
            Connection(pull, speeds[1]),
            Connection(speeds[1], places[1]),
        ]
        blocks = [spring, drag, scope, stretch, force, push, pull, *speeds, *places]
        Simulation(blocks, wires, dt=T, log=False).run(1.0)

    return f"pathsim {version('pathsim')}, its default solver at 1 ms; the mechanics alone", 1, run


times, results = {name: [] for name in tools}, {}
for call in tools.values():
    call()  # Compiles, where a tool does.
for _ in range(ROUNDS):
    for name, call in tools.items():
        start = time.perf_counter()
        results[name] = call()
        times[name].append(time.perf_counter() - start)

print("\n### A sweep beside other tools\n")
print(
    f"{K.size} worlds of 1 s at 1 kHz, stepped to 45° and let go after 0.25 s on their device, two measures, two threads, in turns, {ROUNDS} rounds. numba"
    " and JAX run the sampled loop written by hand for this world ([the programs](../bench/python/worlds.py)), without the time to"
    " compile it; MuJoCo and pathsim have fewer worlds, as one mechanical system without a sampled loop, let go at once. The difference is the largest"
    " of any number, relative to hapt's.\n"
)
print("| | µs a world | times hapt's | difference |\n| --- | --- | --- | --- |")
first = next(iter(times))
for name, spent in times.items():
    worlds, own = 1e6 * np.array(spent) / few[name], 1e6 * np.array(times[first]) / few[first]
    low, middle, high = np.quantile(worlds / own, [0.25, 0.5, 0.75])
    other = results[name]
    difference = "" if other is None else f"{max(np.max(abs(a / b - 1)) for a, b in zip(other, results[first])):.0e}"
    print(f"| {name} | {statistics.median(worlds):.2f} | {middle:.2f} ({low:.2f} to {high:.2f}) | {difference} |")
if absent:
    print(f"\nNot installed here: {', '.join(absent)}.")
