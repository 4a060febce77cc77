"""odrive-can, an independent client, on a simulated ODrive behind a serial adapter: odrive_client.py PORT INERTIA

The wheel is free and without friction, the drive's watchdog at half a second, its position on the bus every 10 ms.
"""

import asyncio
import sys
from math import pi

import can
from odrive_can.odrive import ODriveCAN

TORQUE = 0.01


async def until(what, holds, feed=lambda: None):
    """Waits for it, feeding the drive or not."""
    for _ in range(1000):
        if holds():
            return
        feed()
        await asyncio.sleep(0.01)
    raise AssertionError(f"never: {what}")


async def main(port, inertia):
    bus = can.Bus(interface="slcan", channel=port, bitrate=1000000, sleep_after_open=0)
    drive = ODriveCAN(1, bus)
    seen = []
    drive.feedback_callback = lambda message, _: seen.append((message.data["Pos_Estimate"], message.data["Vel_Estimate"]))
    await asyncio.wait_for(drive.start(), 10)

    def error():
        return str(drive._last_heartbeat.data["Axis_Error"])

    # It answers requests.
    drive.clear_errors()
    assert (await drive.get_bus_voltage_current())["Bus_Voltage"] == 24
    still = await drive.get_encoder_estimates()
    assert still["Vel_Estimate"] == 0

    # A torque: its work is the wheel's energy, at every position and independent of time.
    drive.set_controller_mode("TORQUE_CONTROL", "PASSTHROUGH")
    drive.set_input_torque(0)
    await drive.set_axis_state("CLOSED_LOOP_CONTROL")
    seen.clear()
    await until("a turn", lambda: seen and seen[-1][0] > 1, lambda: drive.set_input_torque(TORQUE))
    for position, velocity in seen:
        energy, work = inertia * (2 * pi * velocity) ** 2 / 2, TORQUE * 2 * pi * (position - still["Pos_Estimate"])
        assert abs(energy - work) < 1e-4 * TORQUE * 2 * pi, (energy, work)

    # Without frames it disarms, and the wheel keeps its velocity.
    await until("the watchdog", lambda: error() == "WATCHDOG_TIMER_EXPIRED")
    assert drive.axis_state == "IDLE"
    seen.clear()
    # Torques, and requests to arm, do not restore the torque.
    await until("positions", lambda: len(seen) > 20, lambda: drive.set_input_torque(TORQUE))
    try:
        await drive.set_axis_state("CLOSED_LOOP_CONTROL")
        raise AssertionError("it has armed with an error")
    except TimeoutError:
        pass
    assert max(velocity for _, velocity in seen) - min(velocity for _, velocity in seen) < 1e-6
    drive.clear_errors()
    await until("no error", lambda: error() == "NONE")

    # Its own controller holds a velocity, and a position.
    drive.set_controller_mode("VELOCITY_CONTROL", "PASSTHROUGH")
    drive.set_input_vel(2)
    await drive.set_axis_state("CLOSED_LOOP_CONTROL")
    await until("2 rev/s", lambda: abs(seen[-1][1] - 2) < 0.01, lambda: drive.set_input_vel(2))
    drive.set_controller_mode("POSITION_CONTROL", "PASSTHROUGH")
    wanted = seen[-1][0] + 1
    steady = lambda: abs(seen[-1][0] - wanted) < 0.01 and abs(seen[-1][1]) < 0.01
    await until("one turn further", steady, lambda: drive.set_input_pos(wanted))

    # An emergency stop.
    drive._send_message("Estop")
    await until("the emergency stop", lambda: error() == "ESTOP_REQUESTED")
    assert drive.axis_state == "IDLE"
    drive.stop()
    print("done")


asyncio.run(main(sys.argv[1], float(sys.argv[2])))
