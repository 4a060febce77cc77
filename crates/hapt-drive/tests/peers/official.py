"""The official moteus library on a simulated drive: official.py PORT [--time N]

The drive has the inertia, damping and limit of the wheel in official.rs. Every check is a law of the protocol or of the puck; none
depends on a clock, except for the watchdog, with a margin of ten.
"""

import asyncio
import math
import statistics
import sys
import time

import moteus

INERTIA = 6.4e-4  # kg m^2
DAMPING = 1.2e-3  # N m s/rad
TAU = 2 * math.pi
R, Mode = moteus.Register, moteus.Mode


def near(a, b, within):
    assert abs(a - b) <= within, f"{a} is not {b} to {within}"


async def it_is_found_and_stands_still(transport, drive):
    found = await transport.discover()
    assert [device.address.can_id for device in found] == [1], found
    values = (await drive.query()).values
    assert values[R.MODE] == Mode.STOPPED and values[R.FAULT] == 0
    assert values[R.POSITION] == 0 and values[R.VELOCITY] == 0 and values[R.TORQUE] == 0
    near(values[R.VOLTAGE], 24, 0.5)


async def a_constant_torque_moves_the_wheel_by_its_inertia_and_damping(drive):
    """theta = tau/b (-J/b ln(1 - b v/tau) - J v/tau), from rest: independent of time."""
    torque = 0.02
    await drive.set_position(position=math.nan, kp_scale=0, kd_scale=0, ilimit_scale=0, feedforward_torque=torque, watchdog_timeout=math.nan)
    seen = 0
    while seen < 20:
        values = (await drive.query()).values
        speed, angle = TAU * values[R.VELOCITY], TAU * values[R.POSITION]
        if values[R.MODE] != Mode.POSITION or speed < 0.5:
            continue
        if DAMPING * speed > 0.9 * torque:
            break
        near(values[R.TORQUE], torque, 1e-6)
        wanted = torque / DAMPING * (-INERTIA / DAMPING * math.log(1 - DAMPING * speed / torque) - INERTIA * speed / torque)
        near(angle / wanted, 1, 1e-3)
        seen += 1
    assert seen > 0
    await drive.set_stop()
    assert (await drive.query()).values[R.MODE] == Mode.STOPPED


async def a_watchdog_that_runs_out_latches_until_a_stop(drive):
    await drive.set_position(position=math.nan, kp_scale=0, kd_scale=0, ilimit_scale=0, feedforward_torque=0.01, watchdog_timeout=0.03)
    await asyncio.sleep(0.3)
    assert (await drive.query()).values[R.MODE] == Mode.TIMEOUT
    for _ in range(3):
        values = (await drive.set_position(position=math.nan, feedforward_torque=0.01, query=True)).values
        assert values[R.MODE] == Mode.TIMEOUT
    await drive.set_stop()
    values = (await drive.query()).values
    assert values[R.MODE] == Mode.STOPPED and values[R.TORQUE] == 0


async def it_goes_where_it_is_sent_and_counts_from_where_it_is_told(drive):
    await drive.set_output_exact(position=2.5)
    near((await drive.query()).values[R.POSITION], 2.5, 0.2)
    await drive.set_position(position=2.6, watchdog_timeout=math.nan)
    for _ in range(2000):
        values = (await drive.query()).values
        if abs(values[R.POSITION] - 2.6) < 1e-3 and abs(values[R.VELOCITY]) < 1e-3:
            break
        await asyncio.sleep(0.005)
    near(values[R.POSITION], 2.6, 1e-3)
    # Every type of answer has the same value, to its own step.
    for kind, step in [(moteus.INT8, 0.01), (moteus.INT16, 1e-4), (moteus.INT32, 1e-5), (moteus.F32, 1e-6)]:
        if kind == moteus.INT8:
            continue  # From -1.27 to 1.27 only.
        values = (await drive.custom_query({R.POSITION: kind})).values
        near(values[R.POSITION], 2.6, 1e-3 + step)
    await drive.set_stop()


async def how_long(drive, count):
    """The p50 of an exchange in us: a command and its answer."""
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        await drive.set_position(position=math.nan, kp_scale=0, kd_scale=0, ilimit_scale=0, feedforward_torque=0, watchdog_timeout=1, query=True)
        times.append(time.perf_counter() - begun)
    await drive.set_stop()
    print(1e6 * statistics.median(times))


async def main():
    transport = moteus.Transport([moteus.FdcanusbDevice(sys.argv[1])])
    drive = moteus.Controller(id=1, transport=transport)
    if len(sys.argv) > 2:
        return await how_long(drive, int(sys.argv[3]))
    await it_is_found_and_stands_still(transport, drive)
    await a_constant_torque_moves_the_wheel_by_its_inertia_and_damping(drive)
    await a_watchdog_that_runs_out_latches_until_a_stop(drive)
    await it_goes_where_it_is_sent_and_counts_from_where_it_is_told(drive)
    print("well")


asyncio.run(main())
