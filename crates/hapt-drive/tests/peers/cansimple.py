"""Decodes and encodes frames of node 1 by ODrive's DBC files: a line in, a line out.

    0.6.10 decode Set_Input_Torque 0000803f00000000      02e Input_Torque=1.0
    0.6.10 encode Heartbeat Axis_State=8 Axis_Error=0    021 0000000008000000
    0.6.10 choice Heartbeat Axis_Error 16777216          WATCHDOG_TIMER_EXPIRED
"""

import sys

from odrive_can import get_dbc

NODE = 1
databases = {version: get_dbc(f"odrive-cansimple-{version}") for version in ("0.5.6", "0.6.10")}

for line in sys.stdin:
    version, what, name, *rest = line.split()
    message = databases[version].get_message_by_name(f"Axis{NODE}_{name}")
    if what == "decode":
        signals = message.decode(bytes.fromhex(rest[0]), decode_choices=False)
        print(f"{message.frame_id:03x}", *(f"{key}={float(value)!r}" for key, value in sorted(signals.items())), flush=True)
    elif what == "choice":
        print((message.get_signal_by_name(rest[0]).choices or {}).get(int(rest[1]), "-"), flush=True)
    else:
        given = {key: float(value) for key, value in (pair.split("=") for pair in rest)}
        signals = {signal.name: given.pop(signal.name, 0) for signal in message.signals}
        assert not given, f"{name} of {version} has no {given}"
        print(f"{message.frame_id:03x}", message.encode(signals, strict=False).hex(), flush=True)
