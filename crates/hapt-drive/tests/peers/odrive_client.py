"""odrive-can, a client of somebody else's, on a simulated ODrive behind a serial adapter: odrive_client.py PORT INERTIA

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

    # What it is asked it answers.
    drive.clear_errors()
    assert (await drive.get_bus_voltage_current())["Bus_Voltage"] == 24
    still = await drive.get_encoder_estimates()
    assert still["Vel_Estimate"] == 0

    # A torque: what it works is the wheel's energy, at every place and whatever the time.
    drive.set_controller_mode("TORQUE_CONTROL", "PASSTHROUGH")
    drive.set_input_torque(0)
    await drive.set_axis_state("CLOSED_LOOP_CONTROL")
    seen.clear()
    await until("a turn", lambda: seen and seen[-1][0] > 1, lambda: drive.set_input_torque(TORQUE))
    for position, velocity in seen:
        energy, work = inertia * (2 * pi * velocity) ** 2 / 2, TORQUE * 2 * pi * (position - still["Pos_Estimate"])
        assert abs(energy - work) < 1e-4 * TORQUE * 2 * pi, (energy, work)

    # Nobody feeds it: it disarms, and the wheel goes on as it was.
    await until("the watchdog", lambda: error() == "WATCHDOG_TIMER_EXPIRED")
    assert drive.axis_state == "IDLE"
    seen.clear()
    # Torques, and the wish to be armed, do not bring it back.
    await until("positions", lambda: len(seen) > 20, lambda: drive.set_input_torque(TORQUE))
    try:
        await drive.set_axis_state("CLOSED_LOOP_CONTROL")
        raise AssertionError("it has armed with an error")
    except TimeoutError:
        pass
    assert max(velocity for _, velocity in seen) - min(velocity for _, velocity in seen) < 1e-6
    drive.clear_errors()
    await until("no error", lambda: error() == "NONE")

    # Its own controller: it keeps a velocity, and a position.
    drive.set_controller_mode("VELOCITY_CONTROL", "PASSTHROUGH")
    drive.set_input_vel(2)
    await drive.set_axis_state("CLOSED_LOOP_CONTROL")
    await until("2 rev/s", lambda: abs(seen[-1][1] - 2) < 0.01, lambda: drive.set_input_vel(2))
    drive.set_controller_mode("POSITION_CONTROL", "PASSTHROUGH")
    wanted = seen[-1][0] + 1
    steady = lambda: abs(seen[-1][0] - wanted) < 0.01 and abs(seen[-1][1]) < 0.01
    await until("one turn further", steady, lambda: drive.set_input_pos(wanted))

    # Somebody hits the button.
    drive._send_message("Estop")
    await until("the emergency stop", lambda: error() == "ESTOP_REQUESTED")
    assert drive.axis_state == "IDLE"
    drive.stop()
    print("done")


asyncio.run(main(sys.argv[1], float(sys.argv[2])))
