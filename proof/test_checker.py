"""What the checker accepts, and what it refuses: python3 -m unittest discover proof"""

import json
import math
import unittest

import checker

# K = 1.5, B = 1e-4: 1e-3 (1.5/2 + 1e-4/1e-3) = 8.5e-4.
WORLD = """
title = "a body on a spring"
[loop]
period = "1 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "8.5e-4 N m s/rad"
[bodies.wheel]
inertia = "0.02 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1 N m/rad"
[[couplings]]
kind = "damper"
between = ["ground", "puck"]
damping = "0.1 N mm s/rad"
[[couplings]]
kind = "wall"
between = ["wheel", "ground"]
side = "below"
at = "-1 rad"
stiffness = "30 N m/rad"
damping = "0.2 N m s/rad"
[[couplings]]
kind = "wall"
between = ["ground", "puck"]
side = "below"
at = "-1 rad"
stiffness = "0.5 N m/rad"
[scenarios.a]
anything = "that is simulated"
"""
LAWS = [(0, "1", "0"), (1, "0", "1e-4"), (3, "1/2", "0")]


def proof(theorem="energy", required="8.5e-4", damping=None, laws=LAWS, claims=("held", "free", "passive"), **times):
    given = {"period": "1e-3", "intervals": ["0.001", "0.001"], "delay": ["0", "0"], "lag": ["0", "0"]} | times
    witness = {"kind": "slopes", "laws": [{"coupling": i, "stiffness": k, "damping": b} for i, k, b in laws]}
    claim = {"theorem": theorem, "times": given, "device_damping": damping or required, "required_damping": required, "witness": witness}
    return {"format": 1, "status": "certified", "claims": [{"claim": name} | claim for name in claims], "without_witness": [], "left_out": []}


def code(world, proof):
    text = proof if isinstance(proof, str) else json.dumps(proof)
    return checker.judge(lambda: checker.check_proof(checker.World(world), text))


# A puck alone, for the laws and the polynomial.
def alone(loop, damping, *couplings, device=""):
    tables = "".join(f'[[couplings]]\nbetween = ["puck", "ground"]\n{coupling}\n' for coupling in couplings)
    return f'[loop]\nperiod = "1 ms"\n{loop}\n[device]\ninertia = 1e-3\ndamping = {damping}\n{device}\n{tables}'


SPRING = 'kind = "spring"\nstiffness = "1 N m/rad"'


class Checker(unittest.TestCase):
    def accepts(self, world, proof):
        result, sentence = code(world, proof)
        self.assertEqual(result, 0, sentence)

    def refuses(self, world, proof, expected=1):
        result, sentence = code(world, proof)
        self.assertEqual(result, expected, sentence)

    def test_a_proof_of_the_world_is_accepted(self):
        self.accepts(WORLD, proof())

    def test_less_damping_than_the_theorem_requires_is_refused(self):
        for less in ("8.4999999e-4", "8.49999999999e-4", "0", "-8.5e-4", "-1"):
            self.refuses(WORLD.replace('"8.5e-4 N', f'"{less} N'), proof())
            self.refuses(WORLD.replace('"8.5e-4 N', f'"{less} N'), proof(damping=less))
            self.refuses(WORLD.replace('"8.5e-4 N', f'"{less} N'), proof(required=less))

    def test_a_change_of_the_world_that_the_proof_does_not_cover_is_refused(self):
        changes = [
            ('"1 N m/rad"', '"1.00001 N m/rad"'),
            ('"1 N m/rad"', '"-1 N m/rad"'),
            ('"1 N m/rad"', '"1 N m"'),
            ('"1 N m/rad"', '"1 N m/deg"'),
            ('"1 N m/rad"', '"1 N m/rad ± 1 %"'),
            ('"1 N m/rad"', "nan"),
            ('"1 N m/rad"', "inf"),
            ('"1 N m/rad"', '"inf N m/rad"'),
            ('"1 N m/rad"', "true"),
            ('"1 N m/rad"', "1979-05-27"),
            ('"1 N m/rad"', '"1e99999999999999999999 N m/rad"'),
            ('"1 N m/rad"', '"１ N m/rad"'),
            ('"1 N m/rad"', '["1 N m/rad"]'),
            ('"1 N m/rad"', "2"),
            ('"0.1 N mm s/rad"', '"0.2 N mm s/rad"'),
            ('"0.1 N mm s/rad"', '"compensating"'),
            ('"-1 rad"\nstiffness = "0.5', '"-1 rad"\nstiffness = "0.6'),
            ('"-1 rad"\nstiffness = "0.5', '"-1 rad"\ndamping = "1e-9 N m s/rad"\nstiffness = "0.5'),
            ('side = "below"', 'side = "left"'),
            ('"1 ms"', '"1.1 ms"'),
            ('"1 ms"', '"1 Ms"'),
            ('"1 ms"', '"1 samples"'),
            ('["puck", "wheel"]', '["puck", "weel"]'),
            ('["puck", "wheel"]', '["puck", "puck"]'),
            ('["puck", "wheel"]', '["puck", "measured"]'),
            ('["puck", "wheel"]', '["puck", "wheel", "ground"]'),
            ('["puck", "wheel"]', '["wheel", "ground"]'),
            ('["wheel", "ground"]', '["wheel", "puck"]'),
            ("[bodies.wheel]", "[bodies.ground]"),
            ("[bodies.wheel]", '[bodies."a b"]'),
            ("[bodies.wheel]", "[bodies.wheel]\nspin = 1"),
            ('"0.02 kg m^2"', '"-0.02 kg m^2"'),
            ('kind = "spring"', 'kind = "springs"'),
            ('kind = "spring"', 'kind = "spring"\ndamping = 1'),
            ('kind = "spring"', 'kind = "friction"\ntorque = 1'),
            ('kind = "spring"', 'kind = "texture"\ntorque = 1'),
            ("title =", "titel ="),
            ("[scenarios.a]", "[stations.a]"),
            ('"difference"', '"exact"'),
            ('"difference"', '"foaw"'),
            ('"difference"', '"low-pass"'),
            ('"difference"', '"low-pass"\ncutoff = "50 Hz"'),
        ]
        for before, after in changes:
            self.assertIn(before, WORLD)
            with self.subTest(after=after):
                self.refuses(WORLD.replace(before, after, 1), proof())

    def test_a_key_of_loop_or_device_that_the_proof_does_not_cover_is_refused(self):
        for key in (
            'output = "start"', 'output = "middle"', 'method = "rk4"', 'method = "tustin"', 'method = "forward-euler"', "advance = 1",
            "advance = true", "advance = 0.5", "bodies_every = 2", 'delay = "1e-9 s"', 'delay = "0.5 samples"', 'delay = "1 sample"',
            'delay_max = "1 us"', 'delay = "-1 us"', 'interval_max = "1.8 ms"', 'interval_max = "0.9 ms"', "horizon = 3",
        ):  # fmt: skip
            with self.subTest(key=key):
                self.refuses(WORLD.replace("[loop]", f"[loop]\n{key}"), proof())
        for key in ('lag = "0.1 ms"', "backlash = 1", "levels = 2048", "encoder = 4000", "encoder = -1", 'limit = "1 N m"', "handle = {}"):
            with self.subTest(key=key):
                self.refuses(WORLD.replace("[device]", f"[device]\n{key}"), proof())
        for table in ("network = 1", "[device.handle]\ninertia = 0\nstiffness = 1", "[device.handle]\ninertia = 1e-3\nstiffness = 1\nmass = 1"):
            with self.subTest(table=table):
                self.refuses(WORLD.replace('title = "a body on a spring"', table), proof())

    def test_what_changes_no_claim_is_accepted(self):
        for before, after in [
            ('"1 N m/rad"', "1"),
            ('"1 N m/rad"', '"1000 N·mm/rad"'),
            ('"1 N m/rad"', '"1 kg m²/s²/rad"'),
            ('"1 N m/rad"', '"1 N m/(rad/s)/s"'),
            ('["puck", "wheel"]', '["wheel", "puck"]'),
            ('"0.02 kg m^2"', '"0.02 N m s^2/rad"'),
            ("[loop]", '[loop]\nmethod = "trapezoidal"\noutput = "end"\ndelay = "0 samples"'),
            ("[loop]", '[loop]\nmethod = "backward-euler"'),
            ('kind = "spring"', 'kind = "spring"\nlimit = "1 N m"'),
            ("[bodies.wheel]", '[device.handle]\ninertia = 1e-3\nstiffness = "100 N m/rad"\n[bodies.wheel]'),
            ('"8.5e-4 N m s/rad"', '"1e-3 N m s/rad +- 15 %"'),
            ('"8.5e-4 N m s/rad"', '"1e-3 ± 0.15e-3 N m s/rad"'),
            ('"8.5e-4 N m s/rad"', '"1e-3 N m s/rad +/- 0.15 N mm s/rad"'),
        ]:
            with self.subTest(after=after):
                self.assertIn(before, WORLD)
                self.accepts(WORLD.replace(before, after, 1), proof())

    def test_a_tolerance_counts_with_its_least_damping_and_its_largest_lag(self):
        self.refuses(WORLD.replace('"8.5e-4 N m s/rad"', '"1e-3 N m s/rad ± 15.1 %"'), proof())
        for wrong in ("1e-3 N m s/rad ± 150 %", "1e-3 N m s/rad ± -15 %", "1e-3 ± 15", "1e-3 N m s/rad ± 0.1 N m", "± 15 %"):
            self.refuses(WORLD.replace('"8.5e-4 N m s/rad"', f'"{wrong}"'), proof())

    def test_what_the_claims_leave_out_of_the_device_is_named(self):
        world = WORLD.replace("[device]", '[device]\nlimit = "1 N m"\nencoder = 4000')
        self.refuses(world, proof())
        self.accepts(world, proof() | {"left_out": ["encoder", "limit"]})
        self.refuses(WORLD, proof() | {"left_out": ["encoder"]})

    def test_a_compensating_damper_counts_with_the_springs_between_its_ends(self):
        springs = '[[couplings]]\nkind = "spring"\nbetween = ["{}", "{}"]\nstiffness = 2\n'
        damper = '[[couplings]]\nkind = "damper"\nbetween = ["{}", "{}"]\ndamping = "compensating"\n'
        ends = WORLD[: WORLD.index("[[couplings]]")]

        def required(first, *rest):
            return ends + springs.format(*first) + springs.format("wheel", "ground") + "".join(damper.format(*e) for e in rest)

        # T K: 2e-3 between puck and wheel; a damper from the wheel to ground counts at no puck.
        self.accepts(
            required(("puck", "wheel"), ("wheel", "puck")).replace("8.5e-4", "3e-3"),
            proof(required="3e-3", laws=[(0, "2", "0"), (2, "0", "2e-3")]),
        )
        self.accepts(required(("puck", "wheel"), ("wheel", "ground")).replace("8.5e-4", "1e-3"), proof(required="1e-3", laws=[(0, "2", "0")]))
        self.refuses(required(("puck", "wheel"), ("ground", "puck")), proof(required="1e-3", laws=[(0, "2", "0")]))

    def test_bodies_at_a_slower_rate_may_have_no_damping_to_the_puck(self):
        world = WORLD.replace("[loop]", "[loop]\nbodies_every = 3")
        self.refuses(world, proof())
        self.accepts(world, proof("two-rates"))
        self.accepts(world.replace('"difference"', '"foaw"').replace('["ground", "puck"]\ndamping', '["ground", "wheel"]\ndamping'),
                     proof("two-rates", "7.5e-4", "8.5e-4", [LAWS[0], LAWS[2]]))  # fmt: skip
        self.refuses(world.replace('["ground", "puck"]\ndamping', '["wheel", "puck"]\ndamping'), proof("two-rates"))

    def test_uneven_intervals_count_with_the_longest(self):
        world = WORLD.replace("[loop]", '[loop]\ninterval_max = "2 ms"').replace("8.5e-4", "1.7e-3")
        self.accepts(world, proof(required="1.7e-3", intervals=["0", "2e-3"]))
        self.refuses(world, proof(required="1.7e-3", intervals=["1e-3", "2e-3"]))
        self.refuses(world, proof(required="8.5e-4", damping="1.7e-3", intervals=["1e-3", "1e-3"]))
        # The longest equal to the period is still every pattern of intervals.
        world = WORLD.replace("[loop]", '[loop]\ninterval_max = "1 ms"')
        self.accepts(world, proof(intervals=["0", "1e-3"]))
        self.refuses(world, proof())

    def test_a_proof_that_is_not_of_its_form_is_refused(self):
        for change in (
            {"format": 2}, {"status": "proved"}, {"status": None}, {"claims": proof()["claims"][:2]}, {"format": True}, {"claims": []}, {"claims": {}}, {"claims": [1]}, {"extra": 1}, {"without_witness": [{"claim": "held"}]},
            {"without_witness": [{"claim": "held", "theorem": "held-energy"}]},
        ):  # fmt: skip
            self.refuses(WORLD, proof() | change)
        for claims in (("certified",), ("held", "held")):
            self.refuses(WORLD, proof(claims=claims))
        for theorem in ("laws", "linear", "held", "", None):
            self.refuses(WORLD, proof(theorem=theorem))
        for laws in (LAWS[:2], LAWS[::-1], LAWS + LAWS[:1], [(2, "30", "0.2")] + LAWS, [(True, "1", "0")] + LAWS[1:]):
            self.refuses(WORLD, proof(laws=laws))
        for number in ("nan", "inf", "1e-3 ", "+1", "01", "1_0", "1/0", "0x1", "١", "1e999999999", "1e1400", "-1e1400", ""):
            self.refuses(WORLD, proof(period=number))
        text = json.dumps(proof())
        self.refuses(WORLD, text.replace('"8.5e-4"', "8.5e-4"))
        self.refuses(WORLD, text.replace('"format": 1', '"format": 1, "format": 1'))
        self.refuses(WORLD, text.replace('"format": 1', '"format": NaN'))
        self.refuses(WORLD, text[:-1], 2)
        self.refuses(WORLD, "[" * 100000, 2)
        self.refuses(WORLD, "[]")

    def test_a_file_that_is_no_world_cannot_be_read(self):
        for world in ("[loop", WORLD + WORLD, WORLD.replace('"1 ms"', '"1 ms"\nperiod = "1 ms"'), "\ufeff" + WORLD, "x = [" * 50000):
            self.refuses(world, proof(), 2)
        self.refuses("", proof())

    def test_laws_at_the_puck_under_a_delay_need_more(self):
        # K T (1/2 + 2)
        late = {"theorem": "laws", "delay": ["2e-3", "0.002"], "laws": [(0, "1", "0")]}
        self.accepts(alone('delay = "2 samples"', 2.5e-3, SPRING), proof(required="2.5e-3", **late))
        self.accepts(alone('delay = "2 ms"', 2.5e-3, SPRING), proof(required="2.5e-3", **late))
        self.refuses(alone('delay = "2.001 ms"', 2.5e-3, SPRING), proof(required="2.5e-3", **late))
        self.refuses(alone('delay = "2 ms"\ndelay_max = "3 ms"', 2.5e-3, SPRING), proof(required="2.5e-3", **late))
        self.refuses(alone('delay = "2 ms"\ninterval_max = "1 ms"', 2.5e-3, SPRING), proof(required="2.5e-3", **late))
        self.refuses(alone('delay = "2 ms"', 2.5e-3, SPRING, device="lag = 1e-9"), proof(required="2.5e-3", **late))
        self.refuses(alone('delay = "2 ms"', 2.5e-3, SPRING, 'kind = "constant"\ntorque = 1'), proof(required="2.5e-3", **late))

    def test_a_filter_of_the_position_counts_as_a_damper(self):
        # (T70): K T (1/2 + p/(1 - p)), p = exp(-2 pi 0.1).
        enough = repr(1e-3 * (0.5 + 1 / math.expm1(0.2 * math.pi)))
        own = {"theorem": "laws", "laws": [(0, "1", "0")], "required": enough}
        self.accepts(alone('filter = "100 Hz"', enough, SPRING), proof(**own))
        for loop in ('filter = "99.9999 Hz"', 'filter = "0 Hz"', 'filter = "-1 Hz"', 'filter = "100 ms"', "filter = true"):
            with self.subTest(loop=loop):
                self.refuses(alone(loop, enough, SPRING), proof(**own))
        self.refuses(alone('filter = "100 Hz"', 5e-4, SPRING), proof(theorem="laws", laws=[(0, "1", "0")], required="5e-4"))
        # The energy theorem is about bodies that see the puck where it is.
        self.refuses(WORLD.replace("[loop]", '[loop]\nfilter = "1 kHz"'), proof())

    def test_a_difference_over_several_samples_is_a_mean_of_earlier_ways_at_the_puck_alone(self):
        laws = {"theorem": "laws", "laws": [(0, "1", "0"), (1, "0", "1e-4")], "required": "6e-4"}
        damper = 'kind = "damper"\ndamping = 1e-4'
        self.accepts(alone('estimator = "difference"\nevery = 5', 6e-4, SPRING, damper), proof(**laws))
        self.refuses(alone('estimator = "difference"\nevery = 257', 6e-4, SPRING, damper), proof(**laws))
        self.refuses(WORLD.replace("[loop]", "[loop]\nevery = 5"), proof())

    def test_a_torque_of_the_device_is_a_part_of_the_hand_and_one_that_the_loop_takes_back_a_law(self):
        gravity = '[device.gravity]\ntorque = "0.4 N m"\nphase = "180 deg"\n'
        cogging = '[device.cogging]\ntorque = 1e-3\npitch = "15 deg"\nsine = [1, 0.5]\n'
        loop = {"theorem": "laws", "laws": [(0, "1", "0")], "required": "5e-4"}
        self.accepts(alone("", 5e-4, SPRING, device=gravity + cogging), proof(**loop))
        for wrong in (
            gravity.replace("0.4", "-0.4"), gravity + "height = 1\n", gravity.replace("180 deg", "180 m"), cogging.replace("[1, 0.5]", "[]"),
            cogging.replace("[1, 0.5]", "[1, 2, 3, 4, 5]"), cogging.replace("15 deg", "0 deg"), cogging.replace("[1,", '["x",'),
        ):  # fmt: skip
            with self.subTest(device=wrong):
                self.refuses(alone("", 5e-4, SPRING, device=wrong), proof(**loop))
        # A detent of a turn: 0.5 · 0.4 N m/rad steep.
        half = '[[compensation]]\nof = "gravity"\nshare = 0.5\n'
        taken = {"theorem": "laws", "laws": [(0, "1", "0"), (1, "0.2", "0")], "required": "6e-4"}
        self.accepts(alone("", 6e-4, SPRING, device=gravity) + half, proof(**taken))
        self.refuses(alone("", 6e-4, SPRING, device=gravity) + half, proof(**loop))
        self.refuses(alone("", 6e-4, SPRING) + half, proof(**taken))
        for wrong in (half.replace("0.5", "1.5"), half.replace("0.5", "-0.5"), half + half, half.replace("gravity", "cogging"), half + "of = 1\n"):
            with self.subTest(compensation=wrong):
                result, _ = code(alone("", 6e-4, SPRING, device=gravity + cogging) + wrong, proof(**taken))
                self.assertNotEqual(result, 0)

    def test_behind_a_shaft_held_needs_the_damping_too(self):
        handle = '[device.handle]\ninertia = 1e-3\nstiffness = "100 N m/rad"\n'
        loop = {"theorem": "laws", "laws": [(0, "1", "0")], "required": "5e-4", "damping": "4e-4", "claims": ("held",)}
        self.accepts(alone("", 4e-4, SPRING), proof(**loop) | {"status": "open"})
        self.refuses(alone("", 4e-4, SPRING, device=handle), proof(**loop) | {"status": "open"})
        self.accepts(alone("", 5e-4, SPRING, device=handle), proof(**loop | {"damping": "5e-4"}) | {"status": "open"})

    def test_friction_and_stops_of_the_device_are_parts_of_the_hand(self):
        friction = 'friction = "1 N mm"\nfriction_backward = "2 N mm"\n'
        falling = '[device.stribeck]\ntorque = "0.5 N mm"\nvelocity = "1 rad/s"\n'
        changing = '[device.friction_by_position]\nshare = 0.15\npitch = "1 rev"\nphase = "10 deg"\nsine = [3, 0, 1.0]\ncosine = [4]\n'
        stops = '[device.stops]\nlow = "-60 deg"\nhigh = "60 deg"\nstiffness = "30 N m/rad"\n'
        own = {"theorem": "laws", "laws": [(0, "1", "0")], "required": "5e-4"}
        self.accepts(alone("", 5e-4, SPRING, device=friction + changing + falling + stops), proof(**own))
        self.accepts(alone("", 5e-4, SPRING, device=stops.replace('low = "-60 deg"\n', "")), proof(**own))
        for wrong in (
            friction.replace("2 N", "-2 N"), falling.replace("1 rad", "0 rad"), falling.replace("0.5", "-0.5"), falling + "width = 1\n",
            stops.replace("-60", "60"), stops.replace('"30', '"0'), stops + "damping = -1\n", '[device.stops]\nstiffness = 1\n',
            changing.replace("0.15", "-0.15"), changing.replace("0.15", "0.17"), changing.replace('"1 rev"', "0"), changing + "torque = 1\n",
            changing.replace("[4]", "[4000]"), changing.replace("sine = [3, 0, 1.0]\ncosine = [4]\n", ""),
        ):  # fmt: skip
            with self.subTest(device=wrong):
                self.refuses(alone("", 5e-4, SPRING, device=wrong), proof(**own))

    def test_friction_takes_torques_of_no_more_than_itself(self):
        term = 'kind = "integral"\nstiffness = 1\ntime = "0.1 s"\nlimit = "0.75 N mm"'
        drag = 'kind = "friction"\ntorque = "0.25 N mm"'
        laws = [(0, "1", "0"), (1, "0", "0"), (2, "0", "0")]
        own = {"theorem": "laws", "laws": laws, "required": "5e-4"}
        enough, both = 'friction = "1 N mm"\n', (SPRING, term, drag)
        self.accepts(alone("", 5e-4, *both, device=enough), proof(**own))
        self.accepts(alone("", 5e-4, SPRING, term.replace('time = "0.1 s"\n', ""), drag, device=enough), proof(**own))
        self.accepts(alone("", 5e-4, *both, device='friction = "1.25 N mm ± 20 %"\n'), proof(**own))
        for less in ("", 'friction = "0.999999999 N mm"\n', enough + 'friction_backward = "0.99 N mm"\n', 'friction = "1.25 N mm ± 21 %"\n'):
            with self.subTest(friction=less):
                self.refuses(alone("", 5e-4, *both, device=less), proof(**own))
        # Half of 2 N mm are left where the harmonics, of sizes 5 and 1.25, are at their least together.
        changing = '[device.friction_by_position]\nshare = 0.08\npitch = "15 deg"\nsine = [3, 1.25]\ncosine = [4]\n'
        self.accepts(alone("", 5e-4, *both, device='friction = "2 N mm"\n' + changing), proof(**own))
        self.accepts(alone("", 5e-4, *both, device='friction = "4 N mm ± 50 %"\n' + changing), proof(**own))
        for less in (changing.replace("0.08", "0.0800001"), changing.replace("1.25", "1.251")):
            self.refuses(alone("", 5e-4, *both, device='friction = "2 N mm"\n' + less), proof(**own))
        for wrong in (term.replace('limit = "0.75 N mm"', ""), term + "\ndamping = 1", drag + "\ncoulomb = 1", drag.replace('torque = "0.25 N mm"', "coulomb = 1")):
            with self.subTest(coupling=wrong):
                self.refuses(alone("", 5e-4, SPRING, wrong, drag, device=enough), proof(**own))
        push = '[[compensation]]\nof = "friction"\nshare = 0.5\nvelocity = "0.1 rad/s"\n'
        given = {"theorem": "laws", "laws": [(0, "1", "0"), (1, "0", "0")], "required": "5e-4"}
        self.accepts(alone("", 5e-4, SPRING, device='friction = "1 N mm ± 50 %"\n') + push, proof(**given))
        self.accepts(alone("", 5e-4, SPRING, device='friction = "1 N mm ± 50 %"\n' + changing) + push, proof(**given))
        self.accepts(alone("", 5e-4, SPRING, 'kind = "assist"\ntorque = "1 N mm"\nvelocity = 1', device=enough), proof(**given))
        self.refuses(alone("", 5e-4, SPRING, 'kind = "assist"\ntorque = "1.001 N mm"\nvelocity = 1', device=enough), proof(**given))
        lift = 'kind = "acceleration"\ninertia = "1e-4 kg m^2"\ncutoff = "10 Hz"\nlimit = "1 N mm"'
        self.accepts(alone("", 5e-4, SPRING, lift, device=enough), proof(**given))
        for wrong in (lift.replace("1 N mm", "1.001 N mm"), lift.replace('limit = "1 N mm"', ""), lift.replace("cutoff", "cutof"), lift + "\ndamping = 1"):
            with self.subTest(coupling=wrong):
                self.refuses(alone("", 5e-4, SPRING, wrong, device=enough), proof(**given))
        for wrong in (push.replace("0.5", "1.1"), push.replace('velocity = "0.1 rad/s"\n', ""), push + push, push.replace("friction", "gravity")):
            with self.subTest(compensation=wrong):
                result, _ = code(alone("", 5e-4, SPRING, device=enough) + wrong, proof(**given))
                self.assertNotEqual(result, 0)
        self.refuses(alone("", 5e-4, SPRING, device='friction = "1 N mm ± 51 %"\n') + push, proof(**given))
        self.refuses(alone("", 5e-4, SPRING) + push, proof(**given))
        # On a body the device's friction takes nothing.
        at_body = WORLD.replace('kind = "spring"', 'kind = "friction"\ntorque = "0.1 N mm"').replace("[bodies", enough + "[bodies")
        self.refuses(at_body.replace('stiffness = "1 N m/rad"', "", 1), proof(laws=[(0, "0", "0"), (1, "0", "1e-4"), (3, "1/2", "0")]))

    def test_a_motor_behind_a_gear_counts_at_the_puck(self):
        # 0.02 x 5² of damping, and 5 x 0.2 N mm of friction.
        motor = '[device.motor]\nratio = 5\ninertia = 1e-6\ndamping = 2e-5\nfriction = "0.2 N mm"\nencoder = 4096\n'
        given = {"theorem": "laws", "laws": [(0, "1", "0"), (1, "0", "0")], "required": "5e-4"}
        push = '[[compensation]]\nof = "friction"\nvelocity = "0.1 rad/s"\n'
        held = proof(**given, damping="6e-4") | {"left_out": ["encoder"]}
        self.accepts(alone("", 1e-4, SPRING, device=motor) + push, held)
        self.refuses(alone("", 1e-4, SPRING, device=motor) + push, held | {"left_out": []})
        self.refuses(alone("", 1e-4, SPRING, device=motor.replace("2e-5", "1.5e-5")) + push, held)
        self.refuses(alone("", 1e-4, SPRING, device=motor.replace("[device.m", "encoder = 400\n[device.m")) + push, held)
        self.refuses(alone("", 1e-4, SPRING, 'kind = "friction"\ntorque = "1.001 N mm"', device=motor), held)
        self.refuses(alone("", 1e-4, SPRING, device=motor + "current = 2\n") + push, held)

    def test_a_polynomial_needs_its_own_coefficients_and_intervals(self):
        # A spring and a damper behind one sample: with s, K T (3/2 - 2 s) - B (1 - 8 s + 8 s²), K T = 1e-3, B = 2e-4, is largest at 0.
        world = alone('estimator = "difference"\ndelay = "1 ms"', 1.3e-3, SPRING, 'kind = "damper"\ndamping = 2e-4')
        witness = {"kind": "polynomial", "coefficients": ["1.3e-3", "-4e-4", "-1.6e-3"], "filter": "0", "intervals": ["0", "1"]}

        def of(required="1.3e-3", **change):
            whole = proof("linear", required, damping="1.3e-3", delay=["1e-3", "1e-3"])
            for claim in whole["claims"]:
                claim["witness"] = witness | change
            return whole

        self.accepts(world, of())
        self.accepts(world, of(intervals=["0", "0.25", "1/2", "1"]))
        for required in ("1.29999e-3", "1.30001e-3", "1e-3", "0", "-1"):
            self.refuses(world, of(required))
        for intervals in (["0"], ["0", "0.5"], ["0.5", "1"], ["0", "0.3", "1"], ["0", "0.25", "1"], ["0", "1", "1"], ["0", "1", "0.5", "1"], []):
            self.refuses(world, of(intervals=intervals))
        for change in ({"filter": "1"}, {"coefficients": ["1.3e-3", "-4e-4"]}, {"coefficients": ["1.3e-3", "-4e-4", "-1.7e-3"]}, {"kind": "slopes"}):
            self.refuses(world, of(**change))
        self.refuses(world.replace('"1 ms"\n[device]', '"1.5 ms"\n[device]'), of())
        self.refuses(world.replace('kind = "damper"', 'kind = "damper"\nlimit = 1'), of())


if __name__ == "__main__":
    unittest.main()
