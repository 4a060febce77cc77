"""Exact numbers, and enclosures of those that are none; quantities with their units, in SI."""

import math
import re
from fractions import Fraction
from functools import lru_cache

SLACK = 1 + Fraction(1, 2**49)  # x >= y counts as true where x SLACK >= y


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
    "rad": (1, 0, 0, 0, 1, 0), "mrad": (1, 0, 0, 0, Fraction(1, 1000), 0), "deg": (1, 0, 0, 0, Fraction(1, 180), 1), "°": (1, 0, 0, 0, Fraction(1, 180), 1),
    "rev": (1, 0, 0, 0, 2, 1), "rpm": (1, 0, 0, -1, Fraction(1, 30), 1),
    "m": (0, 1, 0, 0, 1, 0), "cm": (0, 1, 0, 0, Fraction(1, 100), 0), "mm": (0, 1, 0, 0, Fraction(1, 1000), 0),
    "um": (0, 1, 0, 0, Fraction(1, 10**6), 0), "s": (0, 0, 0, 1, 1, 0), "ms": (0, 0, 0, 1, Fraction(1, 1000), 0),
    "us": (0, 0, 0, 1, Fraction(1, 10**6), 0), "ns": (0, 0, 0, 1, Fraction(1, 10**9), 0), "Hz": (0, 0, 0, -1, 1, 0), "kHz": (0, 0, 0, -1, 1000, 0),
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
ACCELERATION = ((1, 0, 0, -2), (0, 1, 0, -2))
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


def shown(number):
    return f"{float(number):.17g}" if abs(number) < 10**300 else "beyond 1e300"
