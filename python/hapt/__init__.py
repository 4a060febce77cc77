"""Haptic rendering for one-axis devices: simulate a virtual world, certify its stability and passivity, run its loop in other simulators.

>>> import hapt
>>> world = hapt.load("@notes/euler")
>>> run = world.simulate()
>>> run["torque_Nm"].shape
(10001,)
>>> world.check().certified
False

A number is in SI; a string has a unit. The package and the command line use the same crates and give the same results.
"""

from ._analyses import Boundary, Comparison, Design, Identified, Impedance, Piece, Worst
from ._build import (
    Acceleration,
    Assist,
    Constant,
    Damper,
    DeadBand,
    Detent,
    Friction,
    Integral,
    Grip,
    Magnet,
    Path,
    Ramp,
    Sine,
    Spring,
    Step,
    Texture,
    Torque,
    Wall,
)
from ._check import Check
from ._control import StateSpaces
from ._hapt import VERSION as __version__
from ._hapt import WorldError
from ._live import Live
from ._run import Run
from ._running import Device, Loop
from ._shards import Dataset
from ._sweep import Sweep
from ._widget import Widget
from ._world import World, design, identify, load, measures

#: One class is for worlds and for networks.
Network = World

__all__ = [
    "Acceleration",
    "Boundary",
    "Check",
    "Comparison",
    "Constant",
    "Damper",
    "Dataset",
    "DeadBand",
    "Design",
    "Detent",
    "Device",
    "Friction",
    "Assist",
    "Integral",
    "Grip",
    "Identified",
    "Impedance",
    "Live",
    "Loop",
    "Magnet",
    "Network",
    "Path",
    "Piece",
    "Ramp",
    "Run",
    "Sine",
    "Spring",
    "StateSpaces",
    "Step",
    "Sweep",
    "Texture",
    "Torque",
    "Wall",
    "Widget",
    "World",
    "WorldError",
    "Worst",
    "__version__",
    "design",
    "identify",
    "load",
    "measures",
]
