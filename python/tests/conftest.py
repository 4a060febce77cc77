"""A spring to ground, certified, with a hand that releases the puck."""

import hapt
import pytest

WALL = """
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
[[couplings]]
kind = "spring"
between = ["puck", "ground"]
stiffness = "2 N m/rad"
[scenarios.step]
duration = "0.5 s"
hand = { kind = "step", to = "10 deg", release = "0.1 s" }
"""


@pytest.fixture
def world() -> hapt.World:
    return hapt.load(WALL)
