"""The world file, and what the theorems ask of it."""

import math
import re
import struct
import tomllib
from fractions import Fraction

from quantities import (
    ACCELERATION,
    DAMPING,
    E,
    FREQUENCY,
    HALF,
    INERTIA,
    ONE,
    PI,
    POSITION,
    RATIO,
    SLACK,
    STIFFNESS,
    TIME,
    TORQUE,
    TWO,
    VELOCITY,
    ZERO,
    Between,
    Refused,
    Unreadable,
    exact,
    least_of,
    plain_decimal,
    quantity,
    root,
    shown,
    split_quantity,
    tolerated,
)


def in_range(key, value, positive):
    """Zero, or from 1e-30 to 1e30."""
    if value.low < 0 or (value.low == 0 and (positive or value.high != 0)):
        raise Refused(f"{key} is {'not above 0' if positive else 'negative'}")
    if value.high and not Fraction(1, 10**30) <= value.low <= value.high <= 10**30:
        raise Refused(f"{key} is beyond 1e-30 to 1e30")
    return value


def harmonics(table):
    """The factors of up to four sines and as many cosines, in single precision, as they are kept."""
    waves = [table.take(key, []) for key in ("sine", "cosine")]
    if not any(waves) or any(type(wave) is not list or len(wave) > 4 for wave in waves):
        raise Refused(f"{table.name} has no harmonics, or more than four")
    factors = [[quantity(factor, RATIO[0]) for factor in wave + [0] * (4 - len(wave))] for wave in waves]
    if any(factor.size().high > 1000 for wave in factors for factor in wave):
        raise Refused(f"{table.name} has a harmonic beyond 1000")
    single = struct.Struct("f")
    return [[exact(single.unpack(single.pack(float(factor.low)))[0]) for factor in wave] for wave in factors]


class Table:
    """A table of the file: each key is asked for once, and a key that is not asked for is refused."""

    def __init__(self, name, table, is_linear=False):
        if type(table) is not dict:
            raise Refused(f"{name or 'the file'} is not a table")
        self.name, self.left, self.is_linear = name, dict(table), is_linear

    def path(self, key):
        return f"{self.name}.{key}" if self.name else key

    def take(self, key, default=None):
        return self.left.pop(key, default)

    def given(self, key, read, default):
        value = self.left.pop(key, None)
        if value is None:
            if default is None:
                raise Refused(f"{self.path(key)} is missing")
            return default
        try:
            return read(value)
        except Refused as reason:
            raise Refused(f"{self.path(key)}: {reason}") from None

    def any(self, key, kind, default=None):
        return self.given(key, lambda value: quantity(value, kind[self.is_linear]), default)

    def number(self, key, kind, default=None, positive=False):
        return in_range(self.path(key), self.any(key, kind, default), positive)

    def range(self, key, kind, positive=False):
        """The least and the largest of a number with a tolerance."""
        middle, part = self.given(key, lambda value: tolerated(value, kind[self.is_linear]), None if positive else (ZERO, ZERO))
        in_range(self.path(key), middle, positive)
        return middle * (ONE - part), middle * (ONE + part)

    def name_of(self, key, names, default=None):
        value = self.left.pop(key, default)
        if type(value) is not str or value not in names:
            raise Refused(f"{self.path(key)} is {value!r}, and one of {', '.join(names)} is expected")
        return value

    def whole(self, key, default, least, most):
        value = self.left.pop(key, default)
        if type(value) is not int or not least <= value <= most:
            raise Refused(f"{self.path(key)} is {value!r}, and a whole number from {least} to {most} is expected")
        return value

    def close(self):
        for key in self.left:
            raise Refused(f"{self.path(key)} is a key that is not known here")


METHODS = ("forward-euler", "backward-euler", "semi-implicit-euler", "trapezoidal", "zoh", "rk4", "tustin", "foh")
ENERGY_METHODS = ("zoh", "trapezoidal", "backward-euler")
ESTIMATORS = ("exact", "difference", "low-pass", "foaw", "foaw-best", "kalman", "levant")
BODY = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


class Coupling:
    """A law between two ends, with its steepest rise and its damping."""

    def __init__(self, table, ends):
        if table.left.get("kind") == "texture":
            raise Refused(f"{table.name}: no theorem here covers a coupling of the kind {table.left['kind']}")
        kinds = ("spring", "damper", "wall", "detent", "dead-band", "magnet", "constant", "friction", "integral", "assist", "acceleration")
        self.kind = table.name_of("kind", kinds)
        between = table.take("between")
        if type(between) is not list or len(between) != 2 or any(type(end) is not str for end in between):
            raise Refused(f"{table.path('between')} is not a pair of ends")
        if between[0] == between[1] or not set(between) <= ends:
            raise Refused(f"{table.path('between')} has ends that are the same, or not known")
        self.ends = frozenset(between)
        self.stiffness = self.damping = self.within = ZERO
        self.compensates, self.limit = False, None
        getattr(self, "read_" + self.kind.replace("-", "_"))(table)
        if self.kind in ("spring", "damper", "wall", "dead-band") and "limit" in table.left:
            self.limit = table.number("limit", TORQUE, positive=True)
        table.close()

    def read_spring(self, table):
        self.stiffness = table.number("stiffness", STIFFNESS)
        table.any("rest", POSITION, ZERO)

    def read_damper(self, table):
        if table.left.get("damping") == "compensating":
            self.compensates = bool(table.take("damping"))
        else:
            self.damping = table.number("damping", DAMPING)

    def read_wall(self, table):
        table.name_of("side", ("above", "below"))
        table.any("at", POSITION)
        self.stiffness = table.number("stiffness", STIFFNESS)
        self.damping = table.number("damping", DAMPING, ZERO)

    def read_detent(self, table):
        table.any("phase", POSITION, ZERO)
        torque, pitch = table.number("torque", TORQUE), table.number("pitch", POSITION, positive=True)
        self.stiffness = TWO * PI * torque / pitch

    def read_dead_band(self, table):
        table.any("rest", POSITION, ZERO)
        table.number("width", POSITION)
        self.stiffness = table.number("stiffness", STIFFNESS)

    def read_magnet(self, table):
        table.any("at", POSITION, ZERO)
        torque, width = table.number("torque", TORQUE), table.number("width", POSITION, positive=True)
        # -torque x exp((1 - x²)/2), x = (q - at)/width: steepest at x = 0.
        self.stiffness = root(E) * torque / width

    def read_constant(self, table):
        torque = table.any("torque", TORQUE)
        if torque.low != 0 or torque.high != 0:
            raise Refused(f"{table.name}: a constant torque has an energy without a lower bound, and no theorem here covers it")

    def read_friction(self, table):
        self.within_friction(table, table.number("torque", TORQUE))

    def read_integral(self, table):
        table.number("stiffness", STIFFNESS)
        table.number("time", TIME, ONE, positive=True)
        table.any("rest", POSITION, ZERO)
        if "limit" not in table.left:
            raise Refused(f"{table.name}: an integral term without a limit is covered by no theorem")
        self.within_friction(table, table.number("limit", TORQUE, positive=True))

    def read_assist(self, table):
        table.number("velocity", VELOCITY, positive=True)
        self.within_friction(table, table.number("torque", TORQUE))

    def read_acceleration(self, table):
        table.number("inertia", INERTIA)
        table.number("cutoff", FREQUENCY, positive=True)
        if "limit" not in table.left:
            raise Refused(f"{table.name}: no theorem here covers a torque along the acceleration without a limit")
        self.within_friction(table, table.number("limit", TORQUE, positive=True))

    def within_friction(self, table, most):
        """(T76): friction of the device takes a torque of this size at most, whatever it is."""
        if self.ends != {"puck", "ground"}:
            raise Refused(f"{table.name}: no theorem here covers a coupling of the kind {self.kind} at a body")
        self.within = most

    @classmethod
    def of_friction(cls, share, torque):
        """An assist of share · torque."""
        law = cls.of_gravity(ZERO, ZERO)
        law.kind, law.within = "assist", share * torque
        return law

    @classmethod
    def of_gravity(cls, share, torque):
        """A detent of a turn, share · torque · 2 pi/(2 pi) steep."""
        law = cls.__new__(cls)
        law.kind, law.ends = "detent", frozenset(("puck", "ground"))
        law.stiffness, law.damping, law.within = share * torque, ZERO, ZERO
        law.compensates, law.limit = False, None
        return law

    def is_at(self, end):
        return end in self.ends

    def is_at_body(self):
        return not self.ends <= {"puck", "ground"}

    def is_linear(self):
        """Or taken by friction, so that it is none of the couplings of the rest."""
        return self.kind in ("spring", "damper", "constant", "friction", "integral", "assist", "acceleration") and self.limit is None


WHOLE = Fraction(1, 10**6)  # a delay this near to a whole sample is that sample


class World:
    """What the theorems ask of a world file."""

    def __init__(self, text):
        try:
            file = tomllib.loads(text, parse_float=plain_decimal)
        except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
            raise Unreadable(f"the world is not TOML: {error}") from None
        top = Table("", file)
        is_linear = top.name_of("motion", ("rotary", "linear"), "rotary") == "linear"
        if type(top.take("title", "")) is not str:
            raise Refused("title is not text")
        for unused in ("safety", "scenarios"):
            Table(unused, top.take(unused, {}))
        self.read_loop(Table("loop", top.take("loop"), is_linear))
        self.read_device(Table("device", top.take("device"), is_linear))
        ends = {"puck", "ground"}
        bodies = Table("bodies", top.take("bodies", {}))
        for name in list(bodies.left):
            if not BODY.fullmatch(name) or name in ("puck", "ground", "measured"):
                raise Refused(f"bodies has {name!r}, which is no name of a body")
            body = Table(f"bodies.{name}", bodies.take(name), is_linear)
            body.number("inertia", INERTIA, positive=True)
            body.any("position", POSITION, ZERO)
            body.any("velocity", VELOCITY, ZERO)
            body.close()
            ends.add(name)
        self.has_bodies = len(ends) > 2
        couplings, compensations = top.take("couplings", []), top.take("compensation", [])
        top.close()
        if type(couplings) is not list or type(compensations) is not list:
            raise Refused("couplings, or compensation, is not a list of tables")
        self.found = {}  # what each theorem requires, once it has been asked
        self.couplings = [Coupling(Table(f"couplings.{i}", table, is_linear), ends) for i, table in enumerate(couplings)]
        self.read_compensations(compensations, is_linear)
        for index, coupling in enumerate(self.couplings):
            if coupling.compensates:
                springs = [other.stiffness for other in self.couplings if self.compensated(coupling, other)]
                if not springs:
                    raise Refused(f"couplings.{index} compensates no spring")
                coupling.damping = self.period * sum(springs, ZERO)
        if self.bodies_every > 1 and not self.has_bodies:
            raise Refused("loop.bodies_every is above 1 in a world without bodies")

    @staticmethod
    def compensated(damper, other):
        """Springs between the same two ends; of a damper from a body to ground, all springs at the body."""
        if other.kind != "spring":
            return False
        if "ground" in damper.ends and "puck" not in damper.ends:
            return not damper.ends.isdisjoint(other.ends - {"ground"})
        return damper.ends == other.ends

    def read_loop(self, table):
        self.period = table.number("period", TIME, positive=True)
        self.method = table.name_of("method", METHODS, "zoh")
        late = self.method in ("tustin", "foh")
        self.output = table.name_of("output", ("start", "middle", "end"), "start" if late else "end")
        if late and self.output != "start":
            raise Refused(f"loop.output does not go with {self.method}")
        self.advance = table.whole("advance", 0, 0, 1000)
        self.bodies_every = table.whole("bodies_every", 1, 1, 1000)
        self.is_even = "interval_max" not in table.left
        self.longest = table.number("interval_max", TIME, self.period, positive=True)
        if self.longest.low < self.period.low:
            raise Refused("loop.interval_max is below loop.period")
        least = self.read_delay(table, "delay", ZERO)
        largest = self.read_delay(table, "delay_max", least)
        if largest.low < least.low:
            raise Refused("loop.delay_max is below loop.delay")
        self.delay = (least, largest)
        if largest.high > 10**6 * self.period.low:
            raise Refused("loop.delay is more than a million periods")
        self.estimator = table.name_of("estimator", ESTIMATORS, "exact")
        self.cutoff = table.number("cutoff", FREQUENCY, positive=True) if "cutoff" in table.left else None
        if self.cutoff is None and self.estimator in ("low-pass", "kalman"):
            raise Refused("loop.cutoff is missing")
        if "acceleration" in table.left:
            table.number("acceleration", ACCELERATION, positive=True)
        elif self.estimator == "levant":
            raise Refused("loop.acceleration is missing")
        self.every = table.whole("every", 1, 1, 256)
        self.filter = table.number("filter", FREQUENCY, positive=True) if "filter" in table.left else None
        table.whole("window", 16, 1, 256)
        table.close()

    def read_compensations(self, tables, is_linear):
        """Each takes back a torque of the device by the measured position: a coupling between puck and ground, behind the others."""
        taken = set()
        for i, table in enumerate(tables):
            table = Table(f"compensation.{i}", table, is_linear)
            of, share = table.name_of("of", ("gravity", "friction")), table.number("share", RATIO, ONE)
            if of == "friction":
                table.number("velocity", VELOCITY, positive=True)
            table.close()
            there = self.gravity if of == "gravity" else self.nominal_friction
            if of in taken or there is None or share.high > 1:
                raise Refused(f"compensation.{i} takes back what is not there, or more than there is")
            taken.add(of)
            self.couplings.append(Coupling.of_gravity(share, there) if of == "gravity" else Coupling.of_friction(share, there))

    def read_delay(self, table, key, default):
        """A time, or a number of samples."""
        value = table.left.get(key)
        match = re.fullmatch(r"\s*([^a-z]*[0-9.])\s*samples?\s*", value) if type(value) is str else None
        if not match:
            return table.number(key, TIME, default)
        table.take(key)
        number, rest = split_quantity(match[1])
        if rest:
            raise Refused(f"loop.{key} is not a number of samples")
        return in_range(f"loop.{key}", Between(number), False) * self.period

    def read_device(self, table):
        table.range("inertia", INERTIA, positive=True)
        self.read_motor(table)
        self.damping = table.range("damping", DAMPING)[0] + self.motor_damping
        levels = [table.range(key, TORQUE) for key in ("friction", "friction_backward") if key == "friction" or key in table.left]
        levels = [(least + self.motor_friction, most + self.motor_friction) for least, most in levels]
        self.friction, self.nominal_friction = levels[0][0], (levels[0][0] + levels[0][1]) * HALF
        for least, most in levels[1:]:
            self.friction = least_of(self.friction, least)
            self.nominal_friction = least_of(self.nominal_friction, (least + most) * HALF)
        if "friction_by_position" in table.left:
            part = self.least_part(Table("device.friction_by_position", table.take("friction_by_position"), table.is_linear))
            self.friction, self.nominal_friction = self.friction * part, self.nominal_friction * part
        if self.nominal_friction.high == 0:
            self.nominal_friction = None
        # (T74): friction that falls with the speed is Coulomb friction beside what takes power and gives none.
        if "stribeck" in table.left:
            falling = Table("device.stribeck", table.take("stribeck"), table.is_linear)
            falling.number("torque", TORQUE)
            falling.number("velocity", VELOCITY, positive=True)
            falling.close()
        if "stops" in table.left:
            self.read_stops(Table("device.stops", table.take("stops"), table.is_linear))
        _, self.lag_most = lag = table.range("lag", TIME)
        self.lag = lag
        self.left_out = sorted(self.limits_of_motor.union(key for key in ("encoder", "levels", "limit") if key in table.left))
        if "limit" in table.left:
            table.number("limit", TORQUE, positive=True)
        if "levels" in table.left and (table.whole("levels", 2, 2, 2**32 - 1) % 2 or "limit" not in self.left_out):
            raise Refused("device.levels is odd, or without device.limit")
        if "encoder" in table.left and table.is_linear:
            table.number("encoder", POSITION, positive=True)
        elif "encoder" in table.left:
            table.whole("encoder", 1, 1, 2**53)
        # How the puck hangs on its motor's drive changes no number of the device.
        Table("device.drive", table.take("drive", {}))
        self.read_torques(table)
        self.has_handle = "handle" in table.left
        if self.has_handle:
            # (T61): what is passive at the puck is passive at the handle.
            handle = Table("device.handle", table.take("handle"), table.is_linear)
            handle.number("inertia", INERTIA, positive=True)
            handle.number("stiffness", STIFFNESS, positive=True)
            handle.number("damping", DAMPING, ZERO)
            handle.close()
        table.close()

    def read_motor(self, device):
        """A motor turns `ratio` times for one turn of the puck: its damping counts ratio² times there, and its friction `ratio` times."""
        self.motor_damping = self.motor_friction = ZERO
        self.limits_of_motor = set()
        if "motor" not in device.left:
            return
        if device.is_linear:
            raise Refused("device.motor belongs to a rotary device")
        table = Table("device.motor", device.take("motor"))
        ratio = table.number("ratio", RATIO, positive=True)
        table.number("inertia", INERTIA, ZERO)
        self.motor_damping = ratio * ratio * table.number("damping", DAMPING, ZERO)
        self.motor_friction = ratio * table.number("friction", TORQUE, ZERO)
        by_current = [key in table.left for key in ("current", "torque_constant")]
        if by_current == [True, False] or (all(by_current) and "limit" in table.left):
            raise Refused("device.motor has two limits, or a current without its constant")
        self.limits_of_motor = {key for key in ("encoder", "limit") if key in table.left}
        if all(by_current):
            self.limits_of_motor.add("limit")
        for key in ("limit", "current", "torque_constant"):
            if key in table.left:
                table.number(key, TORQUE if key == "limit" else RATIO, positive=True)
        if "encoder" in table.left:
            table.whole("encoder", 1, 1, 2**53)
        if not self.limits_of_motor.isdisjoint(device.left):
            raise Refused("device and device.motor have the same limit, or the same encoder")
        table.close()

    @staticmethod
    def least_part(table):
        """(T74): friction that changes with the position takes this part of its mean at least."""
        share = table.number("share", RATIO)
        table.number("pitch", POSITION, positive=True)
        table.any("phase", POSITION, ZERO)
        most = ZERO
        for sine, cosine in zip(*harmonics(table)):
            most += share * root(sine * sine + cosine * cosine)
        if most.low > 1:
            raise Refused("device.friction_by_position takes friction below 0")
        table.close()
        return Between(max(Fraction(0), 1 - most.high), max(Fraction(0), 1 - most.low))

    @staticmethod
    def read_stops(table):
        """(T75): a stop stores and takes, so that it is a part of the passive hand, whatever its numbers are."""
        ends = [table.any(key, POSITION) for key in ("low", "high") if key in table.left]
        if not ends or (len(ends) == 2 and ends[0].low >= ends[1].low):
            raise Refused("device.stops has no end, or its low end is not below the high one")
        table.number("stiffness", STIFFNESS, positive=True)
        table.number("damping", DAMPING, ZERO)
        table.close()

    def read_torques(self, table):
        """Torques of the device that store energy and give none over a turn: a part of the passive hand, whatever they are."""
        self.gravity = None
        if "gravity" in table.left:
            if table.is_linear:
                raise Refused("device.gravity is a torque of a rotary device")
            gravity = Table("device.gravity", table.take("gravity"), False)
            self.gravity = gravity.number("torque", TORQUE)
            gravity.any("phase", POSITION, ZERO)
            gravity.close()
        if "cogging" in table.left:
            cogging = Table("device.cogging", table.take("cogging"), table.is_linear)
            cogging.number("torque", TORQUE)
            cogging.number("pitch", POSITION, positive=True)
            cogging.any("phase", POSITION, ZERO)
            harmonics(cogging)
            cogging.close()

    # What several theorems assume.

    def at_puck(self):
        return [(index, coupling) for index, coupling in enumerate(self.couplings) if coupling.is_at("puck")]

    def needs_friction(self):
        """(T76): the device's friction takes the torques that it has to take, whatever the rest asks for."""
        within = sum((coupling.within for coupling in self.couplings), ZERO)
        if self.friction.low * SLACK < within.high:
            raise Refused(f"the device's friction of {shown(self.friction.low)} does not take torques of up to {shown(within.high)}")

    def sums(self):
        """K and B: the sums of stiffness and damping at the puck."""
        laws = self.at_puck()
        return sum((law.stiffness for _, law in laws), ZERO), sum((law.damping for _, law in laws), ZERO)

    def comes_at_once(self):
        return self.delay[1].high == 0 and self.lag_most.high == 0

    def has_one_delay(self):
        return self.delay[0].low == self.delay[1].low and self.delay[0].high == self.delay[1].high

    def needs_position(self):
        """Bodies and couplings see the puck where it was measured."""
        if self.filter is not None:
            raise Refused("loop.filter shows the world a position behind the puck's, and this theorem is not about that")

    def needs_mean_velocity(self, of_several=False):
        """A damping at the puck takes the mean velocity of the last interval, or of several, and not that of one instant."""
        if all(coupling.damping.high == 0 for _, coupling in self.at_puck()):
            return
        if self.estimator not in ("difference", "low-pass"):
            raise Refused(f"the estimator {self.estimator} gives a damping at the puck a velocity that no theorem here covers")
        if self.estimator == "difference" and self.every > 1 and not of_several:
            raise Refused(f"a difference over {self.every} samples gives a damping at the puck a velocity that no theorem here covers")
        if self.estimator == "low-pass" and not all(coupling.is_linear() for coupling in self.couplings):
            raise Refused("a velocity from a low-pass beside nonlinear couplings is covered by no theorem here")

    def samples_of_delay(self):
        """The delay in whole samples and the rest, a fraction."""
        ratio = self.delay[1] / self.period
        whole = math.floor(ratio.low + Fraction(1, 2))
        if abs(ratio.low - whole) <= WHOLE and abs(ratio.high - whole) <= WHOLE:
            return whole, ZERO
        whole = math.floor(ratio.low)
        rest = ratio - exact(whole)
        if rest.high >= 1 or rest.low < WHOLE or rest.high > 1 - WHOLE:
            raise Refused("the delay is too near to a whole sample to tell which it is")
        return whole, rest
