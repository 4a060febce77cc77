#!/usr/bin/env python3
"""Decides from a world file alone whether the claims of a proof about it hold.

    python3 checker.py WORLD.toml PROOF.json     one sentence; exit 0 accepted, 1 refused, 2 cannot read
    python3 checker.py --batch FOLDER            the same for each NAME.toml with NAME.json and every NAME.*.json beside it

The proof is what `hapt check WORLD --proof PROOF.json` writes. This file shares nothing with hapt: it reads the world on its own,
in exact rational numbers, and encloses pi, square roots and exponentials between two of them. What it does not know it refuses:
a key, a unit, a coupling or a time for which no theorem stands here.

The claims are about the loop with exact positions and torques: an encoder, the motor's levels and its limit are left out of them,
and a proof has to name which of these its world has. `safety` and `scenarios` enter no claim and are not read.

The file has decimals and hapt computes with doubles. So x >= y counts as true where x (1 + 2^-49) >= y, and a number of the proof
is the same as one computed here where they differ by no more than 2^-48 of it: a change of one of its first 14 digits is seen.
The coefficients of a polynomial are sums that may cancel: there it is 2^-48 of the sum of the sizes.

Equation numbers are those of docs/theory.md.
"""

import json
import math
import os
import re
import sys
import tomllib
from fractions import Fraction
from functools import lru_cache

SLACK = 1 + Fraction(1, 2**49)
SAME = Fraction(1, 2**48)
LEAST = Fraction(1, 2**26)  # a damping that is called the least is so to within this
WHOLE = Fraction(1, 10**6)  # a delay this near to a whole sample is that sample
LEVELS = 60  # how often an interval of a polynomial may be halved
SAMPLES = 32  # the largest whole delay of a polynomial


class Refused(Exception):
    """The proof does not prove its claims, or uses something that this file does not know."""


class Unreadable(Exception):
    """The world or the proof is no file of its kind."""


# --- Numbers: exact rationals, and enclosures of the others ---------------------------------------------------------------------------


class Between:
    """A real number between two rationals."""

    __slots__ = ("low", "high")

    def __init__(self, low, high=None):
        self.low = low
        self.high = low if high is None else high

    def is_exact(self):
        return self.low is self.high or self.low == self.high

    def __add__(self, other):
        if self.low is self.high and other.low is other.high:
            return Between(self.low + other.low)
        return Between(self.low + other.low, self.high + other.high)

    def __neg__(self):
        return Between(-self.low) if self.low is self.high else Between(-self.high, -self.low)

    def __sub__(self, other):
        return self + -other

    def __mul__(self, other):
        if self.low is self.high and other.low is other.high:
            return Between(self.low * other.low)
        if self.low >= 0 and other.low >= 0:
            return Between(self.low * other.low, self.high * other.high)
        products = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Between(min(products), max(products))

    def __truediv__(self, other):
        if other.low <= 0 <= other.high:
            raise Refused("a quotient has a divisor that may be 0")
        if other.low is other.high:
            return self * Between(1 / other.low)
        return self * Between(1 / other.high, 1 / other.low)

    def size(self):
        if self.low >= 0:
            return self
        return -self if self.high <= 0 else Between(Fraction(0), max(-self.low, self.high))


def exact(number):
    return Between(Fraction(number))


ZERO, ONE, TWO, HALF = exact(0), exact(1), exact(2), Between(Fraction(1, 2))
# The digits of pi and e: the first 50 after the point, cut off and raised by one.
PI = Between(*(Fraction(314159265358979323846264338327950288419716939937510 + i, 10**50) for i in (0, 1)))
E = Between(*(Fraction(271828182845904523536028747135266249775724709369995 + i, 10**50) for i in (0, 1)))


def root(x):
    """The square root of a number that is not negative, to about 100 digits."""

    def below(fraction):
        shift = max(0, 340 + fraction.denominator.bit_length() - fraction.numerator.bit_length()) // 2
        return math.isqrt((fraction.numerator << 2 * shift) // fraction.denominator), shift

    if x.low < 0:
        raise Refused("a square root of a negative number")
    (low, down), (high, up) = below(x.low), below(x.high)
    return Between(Fraction(low, 1 << down), Fraction(high + 1, 1 << up) if x.high else Fraction(0))


def exponential(x):
    """e^x for x >= 0."""
    bits = 400

    def bound(y, up):
        # In units of 2^-bits, each step rounded down (up): the series at y/2^halvings <= 1/2, squared again.
        halvings = max(0, math.ceil(y).bit_length() + 1)
        scaled = (y.numerator << bits) // (y.denominator << halvings) + up
        total = term = 1 << bits
        for n in range(1, 90):
            term = (term * scaled >> bits) // n + up
            total += term
        # The rest of the series is far less than one unit.
        total += up
        for _ in range(halvings):
            total = (total * total >> bits) + up
        return Fraction(total, 1 << bits)

    return Between(bound(x.low, 0), bound(x.high, 1))


def x_coth(x):
    """x coth x for x > 0: x (1 + 2/(e^2x - 1))."""
    if x.high < Fraction(1, 2**40):
        return Between(Fraction(1), 1 + x.high**2 / 3)
    if x.low > 200:
        return x * Between(Fraction(1), 1 + Fraction(1, 2**500))
    return x * (ONE + TWO / (exponential(TWO * x) - ONE))


def samples_behind(x):
    """p/(1 - p) of the pole p = e^-x, x > 0: so many samples a filter is behind."""
    if x.low > 400:
        return Between(Fraction(0), Fraction(1, 2**500))
    return ONE / (exponential(x) - ONE)


def least_of(a, b):
    return Between(min(a.low, b.low), min(a.high, b.high))


DECIMAL = re.compile(r"([+-]?)([0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE]([+-]?[0-9]+))?")


def decimal(sign, digits, power):
    if len(digits) > 1200 or (power and len(power) > 5):
        raise Refused("a number has too many digits")
    whole, _, fraction = digits.partition(".")
    shift = int(power or 0) - len(fraction)
    if abs(shift) > 1500:
        raise Refused("a number is beyond all that a double can be")
    value = int(whole + fraction) * (-1 if sign == "-" else 1)
    return Fraction(value * 10**shift) if shift >= 0 else Fraction(value, 10**-shift)


def plain_decimal(text):
    """A number of the TOML file; `inf` and `nan` are none."""
    match = DECIMAL.fullmatch(text.replace("_", ""))
    if not match:
        raise Refused(f"{text} is not a finite number")
    return decimal(*match.groups())


# --- Units ----------------------------------------------------------------------------------------------------------------------------

# Name: the powers of rad, m, kg and s, a rational factor and a power of pi.
POUND = Fraction(45359237 * 980665, 10**13)
UNITS = {
    "rad": (1, 0, 0, 0, 1, 0), "deg": (1, 0, 0, 0, Fraction(1, 180), 1), "°": (1, 0, 0, 0, Fraction(1, 180), 1),
    "rev": (1, 0, 0, 0, 2, 1), "rpm": (1, 0, 0, -1, Fraction(1, 30), 1),
    "m": (0, 1, 0, 0, 1, 0), "cm": (0, 1, 0, 0, Fraction(1, 100), 0), "mm": (0, 1, 0, 0, Fraction(1, 1000), 0),
    "um": (0, 1, 0, 0, Fraction(1, 10**6), 0), "s": (0, 0, 0, 1, 1, 0), "ms": (0, 0, 0, 1, Fraction(1, 1000), 0),
    "us": (0, 0, 0, 1, Fraction(1, 10**6), 0), "Hz": (0, 0, 0, -1, 1, 0), "kHz": (0, 0, 0, -1, 1000, 0),
    "N": (0, 1, 1, -2, 1, 0), "mN": (0, 1, 1, -2, Fraction(1, 1000), 0), "kg": (0, 0, 1, 0, 1, 0),
    "g": (0, 0, 1, 0, Fraction(1, 1000), 0), "J": (0, 2, 1, -2, 1, 0), "Nm": (0, 2, 1, -2, 1, 0),
    "Ncm": (0, 2, 1, -2, Fraction(1, 100), 0), "Nmm": (0, 2, 1, -2, Fraction(1, 1000), 0),
    "mNm": (0, 2, 1, -2, Fraction(1, 1000), 0), "mNmm": (0, 2, 1, -2, Fraction(1, 10**6), 0),
    "in": (0, 1, 0, 0, Fraction(254, 10**4), 0), "kgf": (0, 1, 1, -2, Fraction(980665, 10**5), 0),
    "gf": (0, 1, 1, -2, Fraction(980665, 10**8), 0), "lbf": (0, 1, 1, -2, POUND, 0),
    "oz": (0, 1, 1, -2, POUND / 16, 0), "ozf": (0, 1, 1, -2, POUND / 16, 0),
}  # fmt: skip
for micro in "\u00b5\u03bc":
    UNITS[micro + "m"], UNITS[micro + "s"] = UNITS["um"], UNITS["us"]
TOKEN = re.compile(
    r"\s*(?:([A-Za-z°\u00b5\u03bc]+)|(1)(?![0-9.])|([/*·\u22c5()]))\s*(?:\^([+-]?[0-9]{1,2})(?![0-9])|([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?"
)
RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@lru_cache(maxsize=4096)
def unit(text):
    """Products by a space, · or *, quotients by /, from left to right: a/b c is (a/b) c. Powers, parentheses."""
    tokens, at = [], 0
    text = text.strip()
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            raise Refused(f"{text!r} is not a unit that is known here")
        name, one, symbol, caret, raised = match.groups()
        power = int(caret) if caret else int(raised.translate(RAISED)) if raised else None
        if power is not None and symbol and symbol != ")":
            raise Refused(f"{text!r} has a power of nothing")
        tokens.append((name or one or symbol, 1 if power is None else power))
        at = match.end()
    result, rest = product(tokens, 0, 0)
    if rest != len(tokens):
        raise Refused(f"{text!r} has an unmatched parenthesis")
    return result


def product(tokens, at, depth):
    """The product that begins at this token, and the token after it."""
    total, sign, expects = (0, 0, 0, 0, Fraction(1), 0), 1, True
    if at == 0 and tokens and tokens[0][0] == "/":
        sign, at = -1, 1
    while at < len(tokens):
        name, power = tokens[at]
        if name == ")":
            break
        if name in "/*·\u22c5":
            if expects:
                raise Refused("a unit has nothing before a sign")
            sign, expects, at = (-1 if name == "/" else 1), True, at + 1
            continue
        if name == "(":
            if depth >= 16:
                raise Refused("a unit has too many parentheses")
            factor, at = product(tokens, at + 1, depth + 1)
            if at >= len(tokens):
                raise Refused("a unit has an unmatched parenthesis")
            power = tokens[at][1]
        elif name == "1":
            factor = (0, 0, 0, 0, Fraction(1), 0)
        elif name in UNITS:
            factor = UNITS[name]
        else:
            raise Refused(f"{name!r} is not a unit that is known here")
        power *= sign
        powers = [total[i] + power * factor[i] for i in (0, 1, 2, 3, 5)]
        if max(map(abs, powers)) > 100:
            raise Refused("a unit has too large a power")
        total = (*powers[:4], total[4] * Fraction(factor[4]) ** power, powers[4])
        sign, expects, at = 1, False, at + 1
    if expects:
        raise Refused("a unit is missing")
    return total, at


# Dimensions by name, in rad, m, kg and s: those of a rotary world and of a linear one.
TIME, FREQUENCY = ((0, 0, 0, 1),) * 2, ((0, 0, 0, -1),) * 2
POSITION, VELOCITY = ((1, 0, 0, 0), (0, 1, 0, 0)), ((1, 0, 0, -1), (0, 1, 0, -1))
INERTIA, TORQUE = ((0, 2, 1, 0), (0, 0, 1, 0)), ((0, 2, 1, -2), (0, 1, 1, -2))
STIFFNESS, DAMPING = ((-1, 2, 1, -2), (0, 0, 1, -2)), ((-1, 2, 1, -1), (0, 0, 1, -1))
PER_ANGLE = (-1, 2, 1, 0)
RATIO = ((0, 0, 0, 0),) * 2


def split_quantity(text):
    """The number of a quantity, and the text of its unit."""
    match = DECIMAL.match(text.strip())
    if not match:
        raise Refused(f"{text!r} does not begin with a number")
    return decimal(*match.groups()), text.strip()[match.end() :].strip()


def in_si(number, unit_text, dimension):
    *powers, factor, pis = unit(unit_text)
    powers = tuple(powers)
    if powers != dimension and not (dimension == INERTIA[0] and powers == PER_ANGLE):
        raise Refused(f"{unit_text!r} is a unit of another kind than the one that is wanted")
    value = Between(number * factor)
    for _ in range(abs(pis)):
        value = value * PI if pis > 0 else value / PI
    return value


def quantity(value, dimension):
    if type(value) in (int, Fraction):
        return Between(Fraction(value))
    if type(value) is not str:
        raise Refused(f"{value!r} is not a quantity")
    number, unit_text = split_quantity(value)
    return in_si(number, unit_text, dimension)


def tolerated(value, dimension):
    """A quantity and its tolerance, a fraction of it from 0 to 1."""
    signs = [(value.find(sign), sign) for sign in ("±", "+/-", "+-") if sign in value] if type(value) is str else []
    if not signs:
        return quantity(value, dimension), ZERO
    at, sign = min(signs)
    middle, width = value[:at].strip(), value[at + len(sign) :].strip()
    if width.endswith("%"):
        number, rest = split_quantity(width[:-1])
        if rest:
            raise Refused(f"{value!r} has a tolerance that does not read")
        middle, part = quantity(middle, dimension), Between(number / 100)
    else:
        (number, unit_text), (width, width_unit) = split_quantity(middle), split_quantity(width)
        middle, width = in_si(number, unit_text or width_unit, dimension), in_si(width, width_unit, dimension)
        part = width / middle.size() if width.high != 0 else ZERO
    if part.low < 0 or part.high > 1:
        raise Refused(f"{value!r} has a tolerance beyond 0 to 100 %")
    return middle, part


# --- The world file -------------------------------------------------------------------------------------------------------------------


def in_range(key, value, positive):
    """Zero, or from 1e-30 to 1e30."""
    if value.low < 0 or (value.low == 0 and (positive or value.high != 0)):
        raise Refused(f"{key} is {'not above 0' if positive else 'negative'}")
    if value.high and not Fraction(1, 10**30) <= value.low <= value.high <= 10**30:
        raise Refused(f"{key} is beyond 1e-30 to 1e30")
    return value


class Table:
    """A table of the file: each key is asked for once, and one that nobody asks for is refused."""

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
ESTIMATORS = ("exact", "difference", "low-pass", "foaw", "foaw-best")
BODY = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


class Coupling:
    """A law between two ends, with its steepest rise and its damping."""

    def __init__(self, table, ends):
        if table.left.get("kind") == "texture":
            raise Refused(f"{table.name}: no theorem here covers a coupling of the kind {table.left['kind']}")
        kinds = ("spring", "damper", "wall", "detent", "dead-band", "magnet", "constant", "friction", "integral", "assist")
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
        table.number("time", TIME, positive=True)
        table.any("rest", POSITION, ZERO)
        if "limit" not in table.left:
            raise Refused(f"{table.name}: an integral term without a limit is covered by no theorem")
        self.within_friction(table, table.number("limit", TORQUE, positive=True))

    def read_assist(self, table):
        table.number("velocity", VELOCITY, positive=True)
        self.within_friction(table, table.number("torque", TORQUE))

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
        return self.kind in ("spring", "damper", "constant", "friction", "integral", "assist") and self.limit is None


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
        if self.cutoff is None and self.estimator == "low-pass":
            raise Refused("loop.cutoff is missing")
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
        self.damping, _ = table.range("damping", DAMPING)
        levels = [table.range(key, TORQUE) for key in ("friction", "friction_backward") if key == "friction" or key in table.left]
        self.friction, self.nominal_friction = levels[0][0], (levels[0][0] + levels[0][1]) * HALF
        for least, most in levels[1:]:
            self.friction = least_of(self.friction, least)
            self.nominal_friction = least_of(self.nominal_friction, (least + most) * HALF)
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
        self.left_out = sorted(key for key in ("encoder", "levels", "limit") if key in table.left)
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
            waves = [cogging.take(key, []) for key in ("sine", "cosine")]
            if not any(waves) or any(type(wave) is not list or len(wave) > 4 for wave in waves):
                raise Refused("device.cogging has no harmonics, or more than four")
            for factor in waves[0] + waves[1]:
                quantity(factor, RATIO[0])
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


# --- The theorems: each returns a damping of the device that is enough -----------------------------------------------------------------


def energy(world):
    """(T24), (T40): the step does not raise the energy while the puck is held, and the torque is that of its end."""
    if world.bodies_every != 1:
        raise Refused("the energy theorem is about bodies that step at every sample")
    return of_energy(world)


def two_rates(world):
    """(T62): the same with bodies that step at every n-th sample, where only laws of the position join puck and bodies."""
    if any(coupling.is_at("puck") and coupling.is_at_body() and coupling.damping.high > 0 for coupling in world.couplings):
        raise Refused("bodies at a slower rate are covered where no damping stands between them and the puck")
    return of_energy(world)


def of_energy(world):
    if world.method not in ENERGY_METHODS or world.output != "end" or world.advance:
        raise Refused("the energy theorem is about zoh, trapezoidal and backward-euler with the torque of the end of each step")
    if not world.comes_at_once():
        raise Refused("the energy theorem is about a torque that comes at once, and this one has a delay or a lag")
    world.needs_mean_velocity()
    world.needs_position()
    at_bodies = [coupling for coupling in world.couplings if coupling.is_at_body()]
    for coupling in at_bodies:
        if coupling.kind == "wall" and coupling.damping.high > 0 and (coupling.is_at("puck") or coupling.limit):
            raise Refused("the energy theorem does not cover a damped wall between puck and body, nor one at a body with a limit")
        if coupling.kind == "damper" and coupling.limit and coupling.is_at("puck"):
            # What the body feels and what the puck feels agree only where the step's equations surely have one solution.
            if any(c.kind in ("detent", "magnet") or (c.kind == "wall" and c.damping.high > 0) for c in at_bodies):
                raise Refused("the energy theorem does not cover a damper with a limit beside falling laws or damped walls at bodies")
    stiffness, damping = world.sums()
    return world.longest * (stiffness * HALF + damping / world.period)


def laws(world):
    """(T39), (T40), (T42), (T45), (T46): all couplings stand between puck and ground, with slopes within +-K. A filter is a damper more, (T70)."""
    if world.has_bodies or world.advance:
        raise Refused("the theorem on laws at the puck is about worlds without bodies, and without an advance")
    world.needs_mean_velocity(of_several=True)
    stiffness, damping = world.sums()
    if world.filter is not None:
        damping = damping + stiffness * world.period * samples_behind(TWO * PI * world.filter * world.period)
    period, longest, (least, delay), lag = world.period, world.longest, world.delay, world.lag_most
    if world.comes_at_once():
        return longest * (stiffness * HALF + damping / period)
    if world.is_even and world.has_one_delay() and lag.high == 0:
        whole, rest = world.samples_of_delay()
        mean = period * stiffness * (HALF + exact(whole) + rest) + damping
        spread = rest * (ONE - rest) * period * period * stiffness * stiffness
        return (mean + root(mean * mean + spread)) * HALF
    in_all = stiffness * (TWO * longest / PI + delay + lag)
    of_dampers = damping / period * root(longest * (longest + delay - least))
    if delay.high == 0:
        square = longest * longest / exact(4) + longest * lag + lag * lag * x_coth(longest / lag)
        return least_of(in_all, stiffness * HALF * (longest * HALF + lag + root(square))) + of_dampers
    if world.is_even and lag.high == 0 and delay.high <= period.low:
        part = delay / period
        q = ONE + TWO * part
        square = q * q + exact(4) * part * (ONE - part)
        return stiffness * period / exact(4) * (q + root(square)) + of_dampers
    return in_all + of_dampers


def chebyshev(n):
    """cos(n theta) as a polynomial in s = sin²(theta/2), its coefficients from the constant on."""
    before, now = [1], [1, -2]
    if n == 0:
        return before
    for _ in range(n - 1):
        twice = [2 * c for c in now] + [0]
        shifted = [0] + [-4 * c for c in now]
        before, now = now, [a + b - c for a, b, c in zip(twice, shifted, before + [0, 0])]
    return now


def plus(a, b):
    longer, shorter = (a, b) if len(a) >= len(b) else (b, a)
    return [x + y for x, y in zip(longer, shorter)] + longer[len(shorter) :]


def times(a, b):
    result = [ZERO] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            result[i + j] = result[i + j] + x * y
    return result


def requirement(world):
    """(T29) as b N(s) >= R(s) for 0 <= s <= 1, s = sin²(theta/2): R, the sum of the sizes in each of its coefficients, and N.

    A spring behind d samples gives K T (1/2 + cos theta + ... + cos d theta), a difference -B cos (d + 1) theta, and a low-pass of the time
    constant tau B/T (tau cos d theta - (tau + T) cos (d + 1) theta) over N = 1 + 4 tau (tau + T) s/T².
    """
    if world.has_bodies or world.advance:
        raise Refused("the polynomial is that of a world without bodies, and without an advance")
    if not (world.is_even and world.has_one_delay() and world.lag_most.high == 0):
        raise Refused("the polynomial is that of even samples, one delay and a motor without lag")
    if not all(coupling.is_linear() for coupling in world.couplings):
        raise Refused("the polynomial is that of springs and dampers without limits")
    world.needs_mean_velocity()
    world.needs_position()
    samples, rest = world.samples_of_delay()
    if rest.high != 0 or samples > SAMPLES:
        raise Refused(f"the polynomial is that of a delay of whole samples, {SAMPLES} at most")
    stiffness, damping = world.sums()
    period = world.period
    kernel = [Fraction(1, 2)]
    for i in range(1, samples + 1):
        kernel = plus(chebyshev(i), kernel)
    spring = [stiffness * period * exact(c) for c in kernel]
    later, sooner = chebyshev(samples + 1), chebyshev(samples)
    slope, parts = ZERO, [(spring, [ONE]), ([-(damping * exact(c)) for c in later], [ONE])]
    if world.estimator == "low-pass":
        filtered = ONE / (TWO * PI * world.cutoff)
        slope = exact(4) * filtered * (filtered + period) / (period * period)
        parts = [(spring, [ONE, slope]), ([damping * filtered / period * exact(c) for c in sooner], [ONE])]
        parts.append(([-(damping * (filtered + period) / period * exact(c)) for c in later], [ONE]))
    total, sizes = [ZERO], [ZERO]
    for polynomial, factor in parts:
        total = plus(total, times(polynomial, factor))
        sizes = plus(sizes, times([c.size() for c in polynomial], factor))
    norm = [ONE, slope] if slope.high else [ONE]
    return total, sizes, norm


# --- Witnesses ------------------------------------------------------------------------------------------------------------------------


def same(text, own, what, of=None):
    """Refuses a number of the proof that is not the one computed here, within 2^-48 of it, or of `of`."""
    given = number(text, what)
    room = SAME * max(abs(own.low), abs(own.high)) if of is None else SAME * of.high
    if not own.low - room <= given <= own.high + room:
        raise Refused(f"{what} is {shown(given)} in the proof and {shown(own.low)} by the world file")
    return given


def shown(number):
    return f"{float(number):.17g}" if abs(number) < 10**300 else "beyond 1e300"


NUMBER = re.compile(r"(-?)((?:0|[1-9][0-9]*)(?:\.[0-9]+)?)(?:[eE]([+-]?[0-9]+))?")
QUOTIENT = re.compile(r"(-?[0-9]+)/([1-9][0-9]*)")


def number(text, what):
    if type(text) is not str or len(text) > 1500:
        raise Refused(f"{what} is not a number in quotes")
    if match := QUOTIENT.fullmatch(text):
        return Fraction(int(match[1]), int(match[2]))
    match = NUMBER.fullmatch(text)
    if not match:
        raise Refused(f"{what} is {text[:60]!r}, which is not a number")
    return decimal(*match.groups())


def with_keys(table, keys, what):
    if type(table) is not dict or sorted(table) != sorted(keys):
        raise Refused(f"{what} is not a table with the keys {', '.join(keys)}")
    return [table[key] for key in keys]


def check_slopes(world, witness, bound, claim):
    """The steepest rise and the damping of every coupling at the puck."""
    kind, listed = with_keys(witness, ("kind", "laws"), "the witness")
    own = world.at_puck()
    if kind != "slopes" or type(listed) is not list or len(listed) != len(own):
        raise Refused("the witness is not a list of the slopes of all couplings at the puck")
    for entry, (index, law) in zip(listed, own):
        at, stiffness, damping = with_keys(entry, ("coupling", "stiffness", "damping"), "a law of the witness")
        if type(at) is not int or at != index:
            raise Refused(f"the witness has no slopes of couplings.{index} in its place")
        same(stiffness, law.stiffness, f"the stiffness of couplings.{index}")
        same(damping, law.damping, f"the damping of couplings.{index}")
    same(claim["required_damping"], bound, "the required damping")
    # A puck that is held does not move; one behind a shaft does, and is held where the loop is passive.
    if world.damping.low * SLACK < bound.high and (claim["claim"] != "held" or world.has_handle):
        raise Refused(f"the device's damping of {shown(world.damping.low)} is below {shown(bound.high)}, which the theorem requires")


def bernstein(coefficients, i, level):
    """n! times the Bernstein coefficients on [i, i + 1]/2^level of the polynomial with these whole coefficients, times 2^(level n)."""
    n = len(coefficients) - 1
    moved = [c << level * (n - j) for j, c in enumerate(coefficients)]
    if i:
        for stop in range(n):
            for j in range(n - 1, stop - 1, -1):
                moved[j] += i * moved[j + 1]
    weights = [math.factorial(j) * math.factorial(n - j) for j in range(n + 1)]
    weighted = [weights[j] * moved[j] for j in range(n + 1)]
    return [sum(math.comb(k, j) * weighted[j] for j in range(k + 1)) for k in range(n + 1)]


def whole_coefficients(coefficients):
    """The lower ends of the coefficients, as whole numbers: on s >= 0 the polynomial is above that of the lower ends."""
    scale = math.lcm(*(c.low.denominator for c in coefficients))
    return [c.low.numerator * (scale // c.low.denominator) for c in coefficients]


def check_polynomial(world, witness, found, claim):
    """b N - R has Bernstein coefficients that are 0 or more on each interval, and with less b it is negative between two."""
    total, sizes, norm = found
    kind, coefficients, slope, ends = with_keys(witness, ("kind", "coefficients", "filter", "intervals"), "the witness")
    if kind != "polynomial" or type(coefficients) is not list or type(ends) is not list:
        raise Refused("the witness is not a polynomial with intervals")
    if len(coefficients) != len(total) or not 2 <= len(ends) <= 4096:
        raise Refused(f"the witness has {len(coefficients)} coefficients, and the polynomial {len(total)}")
    for i, (text, own, size) in enumerate(zip(coefficients, total, sizes)):
        same(text, own, f"coefficient {i} of the witness", size)
    same(slope, norm[1] if len(norm) > 1 else ZERO, "the filter of the witness")
    required = number(claim["required_damping"], "the required damping")
    if required < 0 or world.damping.low * SLACK < required:
        raise Refused(f"the device's damping of {shown(world.damping.low)} is below {shown(required)}, which the proof requires")

    def with_damping(damping):
        return plus([Between(damping) * c for c in norm], [-c for c in total])

    enough = whole_coefficients(with_damping(required * SLACK))
    ends = [number(end, "an end of the witness's intervals") for end in ends]
    if ends[0] != 0 or ends[-1] != 1:
        raise Refused("the intervals of the witness do not go from 0 to 1")
    for low, high in zip(ends, ends[1:]):
        width = high - low
        level = width.denominator.bit_length() - 1
        i = low / width if width > 0 else None
        if width.numerator != 1 or width.denominator != 1 << level or level > LEVELS or i.denominator != 1:
            raise Refused(f"{shown(low)} to {shown(high)} is no interval that halving gives")
        if min(bernstein(enough, i.numerator, level)) < 0:
            raise Refused(f"the polynomial is not shown to be positive from sin²(theta/2) = {shown(low)} to {shown(high)}")
    less = [c.high for c in with_damping(required * (1 - LEAST))]
    if required > 0 and all(sum(c * s**j for j, c in enumerate(less)) >= 0 for s in ends):
        raise Refused(f"the required damping is {shown(required)} in the proof, and less is enough")


THEOREMS = {
    "energy": (energy, check_slopes),
    "two-rates": (two_rates, check_slopes),
    "laws": (laws, check_slopes),
    "linear": (requirement, check_polynomial),
}
CLAIMS = ("held", "free", "passive")


STATUS = ("certified", "open", "refuted")


def check_claim(world, claim):
    keys = ("claim", "theorem", "times", "device_damping", "required_damping", "witness")
    name, theorem, times_of, damping, _, witness = with_keys(claim, keys, "a claim")
    if name not in CLAIMS or theorem not in THEOREMS:
        raise Refused(f"the claim {name!r} by the theorem {theorem!r} is not known here")
    world.needs_friction()
    rule, check = THEOREMS[theorem]
    if theorem not in world.found:
        world.found[theorem] = rule(world)
    period, *ranges = with_keys(times_of, ("period", "intervals", "delay", "lag"), "times")
    same(period, world.period, "the period")
    own = [(world.period if world.is_even else ZERO, world.longest), world.delay, world.lag]
    for what, given, pair in zip(("interval", "delay", "lag"), ranges, own):
        if type(given) is not list or len(given) != 2:
            raise Refused(f"times has no least and largest {what}")
        same(given[0], pair[0], f"the least {what}")
        same(given[1], pair[1], f"the largest {what}")
    same(damping, world.damping, "the device's damping")
    check(world, witness, world.found[theorem], claim)


def check_proof(world, text):
    """Checks all claims; returns what they are."""

    def unique(pairs):
        table = dict(pairs)
        if len(table) != len(pairs):
            raise Refused("the proof has a key twice")
        return table

    def no_float(text):
        raise Refused(f"the proof has the number {text} outside of quotes")

    try:
        proof = json.loads(text, object_pairs_hook=unique, parse_float=no_float, parse_constant=no_float)
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"the proof is not JSON: {error}") from None
    form, status, claims, without, left_out = with_keys(proof, ("format", "status", "claims", "without_witness", "left_out"), "the proof")
    if type(form) is not int or form != 1 or type(claims) is not list or type(without) is not list:
        raise Refused("the proof is not of format 1")
    if left_out != world.left_out:
        raise Refused(f"the claims leave out {world.left_out} of the device, and the proof names {left_out}")
    for entry in without:
        name, theorem = with_keys(entry, ("claim", "theorem"), "a claim without a witness")
        if name not in CLAIMS or type(theorem) is not str:
            raise Refused("a claim without a witness is not known here")
    names = [claim.get("claim") if type(claim) is dict else None for claim in claims + without]
    if len(names) != len(set(map(str, names))):
        raise Refused("the proof has a claim twice")
    if status not in STATUS or (status == "certified" and len(names) != len(CLAIMS)):
        raise Refused(f"the status {status!r} does not go with the claims")
    if not claims:
        raise Refused("no claim of the proof has a witness")
    for claim in claims:
        try:
            check_claim(world, claim)
        except Refused as reason:
            raise Refused(f"{claim.get('claim') if type(claim) is dict else 'a claim'}: {reason}") from None
    said = ", ".join(f"{claim['claim']} by {claim['theorem']}" for claim in claims)
    return said + "".join(f"; {entry['claim']} by {str(entry['theorem'])[:60]} has no witness" for entry in without)


# --- The command ----------------------------------------------------------------------------------------------------------------------


def read(path):
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return file.read(8_000_000)
    except (OSError, UnicodeDecodeError) as error:
        raise Unreadable(f"{path}: {error}") from None


def judge(act):
    """An exit code and a sentence."""
    try:
        return 0, f"accepted: {act()}"
    except Refused as reason:
        return 1, f"refused: {reason}"
    except Unreadable as reason:
        return 2, f"cannot read: {reason}"


def batch(folder):
    """One line for each proof: its verdict, its name, and the sentence. The exit code is the largest."""
    try:
        files = sorted(os.listdir(folder))
    except OSError as error:
        print(f"cannot read: {error}")
        return 2
    proofs = {}
    for name in files:
        if name.endswith(".json"):
            proofs.setdefault(name.partition(".")[0], []).append(name)
    worst = 0
    for stem in sorted(proofs):
        world = None

        def opened(stem=stem):
            nonlocal world
            world = World(read(os.path.join(folder, stem + ".toml")))
            return ""

        code, sentence = judge(opened)
        for name in proofs[stem]:
            if world is not None:
                code, sentence = judge(lambda name=name: check_proof(world, read(os.path.join(folder, name))))
            worst = max(worst, code)
            print(f"{code} {name} {sentence}")
    return worst


def main(arguments):
    if len(arguments) != 2:
        print(__doc__.partition("\n\nThe proof")[0], file=sys.stderr)
        return 2
    if arguments[0] == "--batch":
        return batch(arguments[1])
    code, sentence = judge(lambda: check_proof(World(read(arguments[0])), read(arguments[1])))
    print(sentence)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
