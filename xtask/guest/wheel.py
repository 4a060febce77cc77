"""Linux's own driver of a force-feedback wheel on `hapt wheel`: every effect against its closed form, from evdev to the motor.

    wheel.py HAPT                       everything, shortly
    wheel.py HAPT storm                 1000 changes of an effect a second, for a minute
    wheel.py HAPT games                 all effects of fftest and of SDL's own test of haptics
    wheel.py HAPT conform [CASE,...]    hapt wheel --conform on hapt's own wheel

Runs in the guest as root, with Debian's python3-evdev, and for `games` with Debian's joystick and libsdl2-tests. The device is simulated, without a hand; what its motor gave is in the log of the
run. An effect is a stretch of the log in which the torque is not 0.
"""

import csv
import errno
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

from evdev import InputDevice, ecodes, ff, list_devices

WORLD = """
loop.period = "5 ms"
loop.estimator = "difference"
device.inertia = "0.02 kg m^2"
device.damping = "0.1 N m s/rad"
device.limit = "5 N m"
"""
INERTIA, DAMPING, LIMIT, PERIOD = 0.02, 0.1, 5.0, 5e-3
# What full scale means: half of 900 degrees, rad/s, rad/s^2.
ANGLE, VELOCITY, ACCELERATION = 2.5 * math.pi, 10.0, 200.0
LEFT, RIGHT = 0x4000, 0xC000
FULL = 0x7FFF
# Of full scale.
NEAR = 0.02
# The least time without torque between two effects, in s; samples at the end of each that are not looked at, and at the beginning.
MARK = 0.15
END = 20
SETTLED = 80
# Of one effect, a thousand a second.
UPDATES = {"storm": 60000}.get(sys.argv[2] if len(sys.argv) > 2 else "", 5000)
# Of hapt wheel --conform, in the short run.
JUDGED = "constant,gain,sine,spring,dead band,damper,inertia"
# A torque is gone so long after its host, in s.
GONE = 0.3

patience = time.monotonic() + 400


def waited(what, found):
    while not (value := found()):
        if time.monotonic() > patience:
            sys.exit(f"no {what}")
        time.sleep(0.01)
    return value


def wheel(run):
    if run.poll() is not None:
        sys.exit("hapt wheel has ended")
    devices = [InputDevice(path) for path in list_devices()]
    return next((device for device in devices if "hapt wheel" in device.name), None)


def effect(kind, direction=0, **parts):
    return ff.Effect(kind, -1, direction, ff.Trigger(0, 0), ff.Replay(0, 0), ff.EffectType(**parts))


def constant(share, direction=LEFT):
    part = ff.Constant(round(share * FULL), ff.Envelope(0, 0, 0, 0))
    return effect(ecodes.FF_CONSTANT, direction, ff_constant_effect=part)


def periodic(waveform, share, ms):
    part = ff.Periodic(waveform, ms, round(share * FULL), 0, 0, ff.Envelope(0, 0, 0, 0), 0, None)
    return effect(ecodes.FF_PERIODIC, RIGHT, ff_periodic_effect=part)


def condition(kind, share):
    one = ff.Condition(0xFFFF, 0xFFFF, round(share * FULL), round(share * FULL), 0, 0)
    return effect(kind, ff_condition_effect=(ff.Condition * 2)(one, ff.Condition()))


def ramp(share, ms):
    part = ff.Effect(
        ecodes.FF_RAMP, -1, RIGHT, ff.Trigger(0, 0), ff.Replay(ms, 0), ff.EffectType(ff_ramp_effect=ff.Ramp(round(-share * FULL), round(share * FULL)))
    )
    return part


def play(device, effects, seconds):
    """Plays effects together, and leaves a stretch of the log without torque behind them."""
    numbers = [device.upload_effect(one) for one in effects]
    for number in numbers:
        device.write(ecodes.EV_FF, number, 1)
    time.sleep(seconds)
    for number in numbers:
        device.erase_effect(number)
    time.sleep(MARK + 0.2)


def end_velocity(rows):
    return rows[-1]["velocity"]


def end_torque(rows):
    """While the wheel still moves: at rest the sum is 0, and a stretch of the log would end there."""
    return rows[-1]["effects"]


def travelled(rows):
    return rows[-1]["position"] - rows[SETTLED]["position"]


def terminal(torque, damping):
    return torque / damping


def accelerated(torque, inertia, rows):
    """How far a wheel goes, from where both effects play and the body on its spring has come to rest beside it."""
    tau, seconds = inertia / DAMPING, rows[-1]["time"] - rows[SETTLED]["time"]
    end, begin = torque / DAMPING, rows[SETTLED]["velocity"]
    return end * seconds + (begin - end) * tau * (1 - math.exp(-seconds / tau))


def wave(share, form, ms):
    """The largest difference in 95 of 100 samples between the torque and a wave, at the start that fits best."""

    def difference(rows):
        def off(start):
            turns = [(1e3 * (row["time"] - rows[0]["time"]) + start) / ms for row in rows]
            errors = sorted(abs(row["effects"] - share * LIMIT * form(turn % 1.0)) for row, turn in zip(rows, turns))
            return errors[int(0.95 * len(errors))]

        return min(off(start) for start in range(0, 40))

    return difference


def triangle(x):
    return 1 - 4 * abs((x + 0.25) % 1.0 - 0.5)


def torque(rows):
    return rows[len(rows) // 2]["effects"]


HALF = 0.25
STIFF = LIMIT / ANGLE
VISCOUS = LIMIT / VELOCITY
MASS = LIMIT / ACCELERATION
CONSTANT = HALF * LIMIT

# Its name; what plays, for how long in s; what is measured, what it should be, and the full scale of that.
CASES = [
    ("constant to the left", [constant(HALF)], 0.5, torque, lambda _: -CONSTANT, LIMIT),
    ("constant to the right", [constant(HALF, RIGHT)], 0.5, torque, lambda _: CONSTANT, LIMIT),
    ("spring", [constant(HALF), condition(ecodes.FF_SPRING, 1)], 0.7, end_torque, lambda rows: -CONSTANT - STIFF * rows[-1]["position"], LIMIT),
    ("half a spring", [constant(HALF, RIGHT), condition(ecodes.FF_SPRING, 0.5)], 0.7, end_torque, lambda rows: CONSTANT - 0.5 * STIFF * rows[-1]["position"], LIMIT),
    ("damper", [constant(HALF), condition(ecodes.FF_DAMPER, 1)], 1.5, end_velocity, lambda _: terminal(-CONSTANT, DAMPING + VISCOUS), VELOCITY),
    ("half a damper", [constant(HALF, RIGHT), condition(ecodes.FF_DAMPER, 0.5)], 1.5, end_velocity, lambda _: terminal(CONSTANT, DAMPING + 0.5 * VISCOUS), VELOCITY),
    ("friction", [constant(HALF), condition(ecodes.FF_FRICTION, 0.1)], 3.0, end_velocity, lambda _: terminal(-CONSTANT + 0.1 * LIMIT, DAMPING), VELOCITY),
    ("inertia", [condition(ecodes.FF_INERTIA, 1), constant(HALF, RIGHT)], 1.5, travelled, lambda rows: accelerated(CONSTANT, INERTIA + MASS, rows), ANGLE),
    ("sine", [periodic(ecodes.FF_SINE, 0.5, 400)], 2.0, wave(0.5, lambda x: math.sin(math.tau * x), 400), lambda _: 0.0, LIMIT),
    ("triangle", [periodic(ecodes.FF_TRIANGLE, 0.5, 400)], 2.0, wave(0.5, triangle, 400), lambda _: 0.0, LIMIT),
    ("square", [periodic(ecodes.FF_SQUARE, 0.5, 400)], 2.0, wave(0.5, lambda x: 1.0 if x < 0.5 else -1.0, 400), lambda _: 0.0, LIMIT),
    ("sawtooth up", [periodic(ecodes.FF_SAW_UP, 0.5, 400)], 2.0, wave(0.5, lambda x: 2 * x - 1, 400), lambda _: 0.0, LIMIT),
    ("sawtooth down", [periodic(ecodes.FF_SAW_DOWN, 0.5, 400)], 2.0, wave(0.5, lambda x: 1 - 2 * x, 400), lambda _: 0.0, LIMIT),
    ("ramp", [ramp(0.5, 1000)], 1.3, wave(0.5, lambda x: 2 * x - 1, 1000), lambda _: 0.0, LIMIT),
]


def stretches(path):
    """The stretches of a run in which effects gave a torque."""
    found, idle = [], math.inf
    with open(path, newline="") as file:
        for line in csv.DictReader(file):
            row = {
                "time": float(line["time_s"]),
                "position": float(line["measured_rad"]),
                "velocity": float(line["measured_rad_per_s"]),
                "effects": float(line["link_Nm"]),
            }
            if abs(row["effects"]) < 1e-4 * LIMIT:
                idle += PERIOD
                # Within a stretch it may pass through 0.
                if idle < MARK and found:
                    found[-1].append(row)
                continue
            if idle >= MARK:
                found.append([])
            idle = 0.0
            found[-1].append(row)
    for rows in found:
        while abs(rows[-1]["effects"]) < 1e-4 * LIMIT:
            rows.pop()
        # The effects of a stretch are erased one by one, and fade.
        del rows[-END:]
    return [rows for rows in found if rows]


def storm(device):
    """Changes an effect a thousand times a second, or as often as the guest can; the driver sends those that are changes."""
    one = constant(0.0)
    one.id = device.upload_effect(one)
    device.write(ecodes.EV_FF, one.id, 1)
    begin, changes = time.monotonic(), 0
    for at in range(UPDATES):
        level = round(0.1 * FULL * math.sin(0.01 * at))
        changes += level != one.u.ff_constant_effect.level
        one.u.ff_constant_effect.level = level
        device.upload_effect(one)
        time.sleep(max(0.0, begin + 1e-3 * (at + 1) - time.monotonic()))
    seconds = time.monotonic() - begin
    print(f"{changes} changes at {UPDATES / seconds:.0f} updates a second for {seconds:.0f} s")
    one.u.ff_constant_effect.level = round(HALF * FULL)
    device.upload_effect(one)
    time.sleep(0.5)
    device.erase_effect(one.id)
    time.sleep(MARK + 0.2)
    return changes


def attached(hapt, *arguments):
    """hapt wheel, at full torque, and the device that the kernel shows."""
    run = subprocess.Popen([hapt, "wheel", *arguments], stdout=subprocess.PIPE, text=True)
    device = waited("wheel", lambda: wheel(run))
    # Games read the steering as it is.
    waited("axis without a filter", lambda: device.absinfo(ecodes.ABS_X).fuzz == 0)
    # Full torque is there a second after the start.
    time.sleep(1.5)
    return run, device


def detached():
    """Whether the kernel has taken the wheel away."""
    return not any("hapt wheel" in InputDevice(path).name for path in list_devices())


def killed(hapt_device):
    """A client that is killed while its effect plays; for how long it lived, in s."""
    begin = time.monotonic()
    client = os.fork()
    if client == 0:
        own = InputDevice(hapt_device.path)
        own.write(ecodes.EV_FF, own.upload_effect(constant(HALF)), 1)
        time.sleep(60)
    time.sleep(0.5)
    os.kill(client, signal.SIGKILL)
    os.waitpid(client, 0)
    lived = time.monotonic() - begin
    time.sleep(MARK + 0.2)
    return lived


def shared(device):
    """Two clients, an effect of each; one more than the pool has is refused, and so is an effect of another client."""
    other = InputDevice(device.path)
    one, two = device.upload_effect(constant(0.5 * HALF)), other.upload_effect(constant(0.5 * HALF))
    device.write(ecodes.EV_FF, one, 1)
    other.write(ecodes.EV_FF, two, 1)
    time.sleep(0.5)
    more = []
    try:
        while len(more) < 100:
            more.append(device.upload_effect(constant(1.0)))
        sys.exit("the pool has no end")
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
    try:
        other.erase_effect(one)
        sys.exit("a client erases the effect of another one")
    except OSError as error:
        if error.errno != errno.EACCES:
            raise
    for number in more:
        device.erase_effect(number)
    device.erase_effect(one)
    other.erase_effect(two)
    print(f"{len(more) + 2} effects at most")
    time.sleep(MARK + 0.2)


def suspended():
    """What the kernel makes of a suspend while the wheel is attached."""
    with open("/sys/power/pm_test", "w") as file:
        file.write("devices")
    try:
        with open("/sys/power/state", "w") as file:
            file.write("mem")
        return "the computer suspends"
    except OSError as error:
        return f"refused: {error.strerror}"


def ended(run, device, by, code):
    """hapt wheel ends by a signal while an effect plays: nothing is left attached."""
    device.write(ecodes.EV_FF, device.upload_effect(constant(HALF)), 1)
    time.sleep(0.2)
    begin = time.monotonic()
    run.send_signal(by)
    run.communicate()
    waited("detachment", detached)
    if run.returncode != code:
        sys.exit(f"{by.name} ends hapt wheel with {run.returncode}, and not {code}")
    return time.monotonic() - begin


def taken_away(hapt):
    """The kernel takes the wheel away while a constant and a spring play: by its driver, its configuration, or altogether. hapt ends by itself."""
    for how in ["unbind", "bConfigurationValue", "authorized"]:
        run, device = attached(hapt, "wheel.toml")
        for effect in [constant(HALF), condition(ecodes.FF_SPRING, 1)]:
            device.write(ecodes.EV_FF, device.upload_effect(effect), 1)
        time.sleep(0.2)
        usb = next(path.parent for path in pathlib.Path("/sys/bus/usb/devices").glob("*/product") if path.read_text().strip() == "hapt wheel")
        begin = time.monotonic()
        if how == "unbind":
            pathlib.Path("/sys/bus/usb/drivers/usbhid/unbind").write_text(f"{usb.name}:1.0")
        else:
            (usb / how).write_text("0")
        try:
            run.communicate(timeout=GONE + 5)
        except subprocess.TimeoutExpired:
            run.kill()
            sys.exit(f"the wheel plays on after {how}")
        if run.returncode != 3:
            sys.exit(f"{how} ends hapt wheel with {run.returncode}, and not 3")
        print(f"{how:24} hapt ends after {time.monotonic() - begin:.2f} s")
        device.close()
        waited("detachment", detached)


def refused(command, code, words):
    """A command that is refused, with its exit code and what it says."""
    done = subprocess.run(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    if done.returncode != code or words not in done.stderr:
        sys.exit(f"{command} ends with {done.returncode}, and not {code}: {done.stderr}")


def conformed(hapt, cases):
    only = ["--only", cases] if cases else []
    return subprocess.run([hapt, "wheel", "--conform", "--yes", "--out", "conform.html", *only]).returncode


def games(hapt):
    """The test programs that others wrote, each of whose effects is to be played; what gives a torque at rest is seen in the log."""
    run, device = attached(hapt, "wheel.toml", "--dry", "--duration", "400 s", "--log", "wheel.mcap")
    fftest = subprocess.Popen(["fftest", device.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    for number in range(6):
        fftest.stdin.write(f"{number}\n")
        fftest.stdin.flush()
        time.sleep(6)
    said, _ = fftest.communicate("-1\n")
    print(said)
    if fftest.returncode != 0 or "Error" in said or "error" in said or said.count("OK (id") < 6:
        sys.exit(f"fftest ends with {fftest.returncode}")
    sdl = subprocess.run(
        ["/usr/libexec/installed-tests/SDL2/testhaptic"],
        env={**os.environ, "SDL_VIDEODRIVER": "dummy", "SDL_AUDIODRIVER": "dummy"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    print(sdl.stdout)
    if sdl.returncode != 0 or "rror" in sdl.stdout:
        sys.exit(f"SDL's testhaptic ends with {sdl.returncode}")
    summary, found = recorded(run)
    print(summary)
    for rows in found:
        print(f"{rows[0]['time']:8.3f} s to {rows[-1]['time']:8.3f} s, {min(row['effects'] for row in rows):8.4f} to {max(row['effects'] for row in rows):8.4f} N m")
    if "refused" in summary:
        sys.exit("some reports were refused")
    # fftest's waves and torque; SDL's waves, its constant torque, its ramp and its rumble, with conditions at rest between them.
    if len(found) < 4:
        sys.exit("some effects gave no torque")


def untainted():
    with open("/proc/sys/kernel/tainted") as file:
        if int(file.read()) != 0:
            sys.exit("the kernel is tainted")


def judged(name, value, want, full):
    """Whether a number is near what it has to be."""
    off = abs(value - want) / full
    print(f"{name:24} {value:9.4f} {want:9.4f} {100 * off:6.2f} % of full scale{'  WRONG' if off > NEAR else ''}")
    return off <= NEAR


def recorded(run):
    """Ends a run with a log: what it said, and its stretches of torque."""
    run.send_signal(signal.SIGINT)
    summary, _ = run.communicate()
    subprocess.run(["rm", "-f", "wheel.csv"], check=True)
    subprocess.run([sys.argv[1], "log", "convert", "wheel.mcap", "-o", "wheel.csv"], check=True, stdout=subprocess.DEVNULL)
    return summary, stretches("wheel.csv")


def main():
    hapt, *mode = sys.argv[1:]
    os.chdir("/tmp")
    with open("wheel.toml", "w") as file:
        file.write(WORLD)
    if mode == ["games"]:
        games(hapt)
        untainted()
        sys.exit(0)
    if mode and mode[0] == "conform":
        # The swing that judges a wheel is a loop that a host closes, and would be damped.
        run, _ = attached(hapt, "wheel.toml", "--dry")
        code = conformed(hapt, " ".join(mode[1:]))
        run.send_signal(signal.SIGINT)
        run.communicate()
        untainted()
        sys.exit(code)
    # The storm's slow sine swings the wheel as a game that follows it would: such a loop would be damped.
    run, device = attached(hapt, "wheel.toml", "--dry", "--duration", "400 s", "--log", "wheel.mcap")
    whole = mode != ["storm"]
    for _, effects, seconds, *_ in CASES if whole else []:
        play(device, effects, seconds)
    changes = storm(device)
    if whole:
        shared(device)
        lived = killed(device)
        print(f"suspend                  {suspended()}")
    summary, found = recorded(run)
    print(summary)
    after = [("after the storm", None, None, end_torque, lambda _: -CONSTANT, LIMIT)]
    clients = [("two clients", None, None, torque, lambda _: -CONSTANT, LIMIT)]
    cases = CASES + after + clients if whole else after
    # The killed client's is the last.
    if len(found) != len(cases) + whole:
        for rows in found:
            print(f"{rows[0]['time']:8.3f} s to {rows[-1]['time']:8.3f} s, {rows[0]['effects']:8.4f} to {rows[-1]['effects']:8.4f} N m")
        sys.exit(f"{len(found)} stretches of torque")
    wrong = [name for rows, (name, _, _, value, want, full) in zip(found, cases) if not judged(name, value(rows), want(rows), full)]
    taken = int(re.search(r"([0-9 ]+) reports taken", summary)[1].replace(" ", ""))
    print(f"{'reports':24} {taken} taken, for {changes} changes of the storm")
    if taken < changes:
        sys.exit("some were lost")
    if whole:
        # The end of a stretch is cut off.
        played = found[-1][-1]["time"] - found[-1][0]["time"] + END * PERIOD
        print(f"a killed client's effect   {played:.2f} s, of the {lived:.2f} s that the client lived")
        if played > lived + GONE:
            sys.exit("the effect of a killed client plays on")
        for by, code in [(signal.SIGTERM, 143), (signal.SIGKILL, -signal.SIGKILL)]:
            run, device = attached(hapt, "wheel.toml", "--dry")
            if by == signal.SIGTERM and conformed(hapt, JUDGED) != 0:
                sys.exit("hapt wheel --conform finds something wrong")
            print(f"{by.name:24} nothing is attached after {ended(run, device, by, code):.2f} s")
        taken_away(hapt)
        refused([hapt, "wheel", "--conform", "--yes"], 3, "there is no wheel with force feedback")
        refused([hapt, "wheel", "--conform"], 3, "there is no wheel with force feedback")
        refused(["setpriv", "--reuid=65534", "--clear-groups", hapt, "wheel"], 3, "needs root")
        subprocess.run(["rmmod", "vhci_hcd"], check=False)
        if not os.path.exists("/sys/devices/platform/vhci_hcd.0"):
            refused([hapt, "wheel"], 3, "modprobe vhci-hcd")
    untainted()
    sys.exit(f"wrong: {', '.join(wrong)}" if wrong else 0)


main()
