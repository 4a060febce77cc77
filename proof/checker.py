#!/usr/bin/env python3
"""Decides from a world file alone whether the claims of a proof about it hold.

    python3 checker.py WORLD.toml PROOF.json     one sentence; exit 0 accepted, 1 refused, 2 cannot read
    python3 checker.py --batch FOLDER            the same for each NAME.toml with NAME.json and every NAME.*.json beside it

The proof is what `hapt check WORLD --proof PROOF.json` writes. This file, world.py and quantities.py share nothing with hapt: they read the
world on their own, in exact rational numbers, and enclose pi, square roots and exponentials between two of them. What they do not know
they refuse: a key, a unit, a coupling or a time for which no theorem stands here.

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
from fractions import Fraction

from quantities import (
    HALF,
    ONE,
    PI,
    SLACK,
    TWO,
    ZERO,
    Between,
    Refused,
    Unreadable,
    decimal,
    exact,
    least_of,
    root,
    samples_behind,
    shown,
    x_coth,
)
from world import ENERGY_METHODS, World

SAME = Fraction(1, 2**48)
LEAST = Fraction(1, 2**26)  # a damping that is called the least is so to within this
LEVELS = 60  # how often an interval of a polynomial may be halved
SAMPLES = 32  # the largest whole delay of a polynomial


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
