"""Worlds and networks: reading, changing, analysing, running."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hapt, _toml
from ._analyses import Comparison, Design, Identified, Impedance, Worst
from ._arrays import numbers
from ._check import Check
from ._control import StateSpaces, state_spaces
from ._live import Live
from ._program import ran
from ._run import Run
from ._running import Device, Loop
from ._system import System, a_key, a_scenario, items, text_of, whole
from ._widget import Widget

Value = Union[str, float, int]

#: The largest number of rows of an impedance.
_POINTS = 100_000


class World(System):
    """A world: bodies and couplings, the loop that runs them, the device, and scenarios. It is immutable; `set` returns a changed copy.

    A network is of the same class. It has several stations, each with a world, and links between their pucks.

    The constructor takes the tables of the world file as keywords, with the units and errors of the file:

    >>> import hapt
    >>> world = hapt.World(
    ...     loop={"period": "1 ms"},
    ...     device={"inertia": "6.4e-4 kg m^2", "damping": "1.2e-3 N m s/rad"},
    ...     bodies={"wheel": {"inertia": "0.0258 kg m^2"}},
    ...     couplings=[hapt.Spring(("puck", "wheel"), stiffness="17.8 N mm/deg")],
    ...     scenarios={"step": {"duration": "1 s", "hand": hapt.Step("45 deg")}},
    ... )
    >>> round(float(abs(world.simulate()["torque_Nm"]).max()), 3)
    0.801

    A network is read from its file:

    >>> network = hapt.load("networks/pair.toml")
    >>> network.stations, network.links
    (['left', 'right'], [('left', 'right')])
    >>> softer = network.set("links.0.age_max", "60 ms").set("links.0.stiffness", 0.05)
    >>> softer.get("links.0.stiffness"), softer.check().certified
    (0.05, True)
    >>> network.run()["right"]["link_Nm"].shape
    (1001,)

    Raises WorldError for values that the reader refuses, TypeError for types that a world file does not have.
    """

    def __init__(
        self,
        *,
        loop: Mapping[str, Any],
        device: Mapping[str, Any],
        bodies: Optional[Mapping[str, Any]] = None,
        couplings: Sequence[Any] = (),
        compensation: Sequence[Any] = (),
        scenarios: Optional[Mapping[str, Any]] = None,
        safety: Optional[Mapping[str, Any]] = None,
        title: Optional[str] = None,
        motion: Optional[str] = None,
    ) -> None:
        tables = {
            "title": title,
            "motion": motion,
            "loop": loop,
            "device": device,
            "safety": safety,
            "bodies": bodies or None,
            "couplings": items("couplings", couplings) or None,
            "compensation": items("compensation", compensation) or None,
            "scenarios": scenarios or None,
        }
        self._native = _hapt.read("world", _toml.document(_toml.plain(tables, "")))

    @classmethod
    def _of(cls, native: _hapt.World) -> World:
        world = cls.__new__(cls)
        world._native = native
        return world

    @classmethod
    def load(cls, source: Union[str, os.PathLike[str], Mapping[str, Any]]) -> World:
        """The same as `hapt.load`."""
        return load(source)

    # Keys

    def set(self, key: str, value: Any) -> World:
        """A copy in which `key` has the value `value`.

        `key` is a dotted path such as "loop.period", "links.0.age_max" or "stations.left.loop.period". A string has a unit ("2 ms"), a number
        is in SI; NumPy's scalars are numbers. Raises WorldError for an unknown key or a value that the world file would refuse, with a caret
        under the mistake.

        >>> import hapt
        >>> world = hapt.load('loop.period = "1 ms"\\ndevice.inertia = 6.4e-4')
        >>> world.set("loop.period", "2 ms").get("loop.period")
        0.002
        """
        value = _toml.plain(value, key)
        return World._of(self._native.set(a_key(key), value if isinstance(value, str) else _toml.inline(value)))

    def get(self, key: str) -> Optional[Value]:
        """The value of a key: a number in SI or a str. A key that is not set has its default, or None where it has no default.

        Raises KeyError for a key that the world or network does not have.
        """
        for path, value in self._native.parameters():
            if path == key:
                return value
        is_known, number = self._native.number(a_key(key))
        if is_known:
            return number
        raise self._native.no_such_key(key)

    def parameters(self) -> dict[str, Value]:
        """The keys of the world, or of the stations' worlds, with their values as `get` returns them, in file order."""
        return dict(self._native.parameters())

    def to_toml(self) -> str:
        """The text of a world file with all changes applied. Raises ValueError for a network, which has several files."""
        return self._native.to_toml()

    @property
    def name(self) -> str:
        """The title; without one, the name of the file or text that it was read from."""
        return self._native.name

    @property
    def stations(self) -> list[str]:
        """The names of a network's stations in file order; empty for a world."""
        return self._native.stations

    @property
    def links(self) -> list[tuple[str, str]]:
        """The two stations of each link of a network, in file order; empty for a world."""
        return self._native.links

    @property
    def bodies(self) -> list[str]:
        """The names of the bodies in file order. Raises ValueError for a network."""
        return self._native.bodies

    @property
    def scenarios(self) -> list[str]:
        """The names of the scenarios in file order."""
        return self._native.scenarios

    def __repr__(self) -> str:
        stations = f": {', '.join(self.stations)}" if self.stations else ""
        return f"<hapt.World {self.name!r}{stations}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, World) and self._native.identity() == other._native.identity()

    def __hash__(self) -> int:
        return hash(self._native.identity())

    def __reduce__(self) -> tuple[Any, ...]:
        return (_world, self._native.parts())

    # Runs and analyses

    def simulate(self, scenario: Optional[str] = None) -> Run:
        """Runs a scenario of a world, by default its only one: the loop on the device, which is integrated exactly.

        Where the state stops being finite, the run ends with a RuntimeWarning; it keeps the rows before, and `Run.ended` is the reason.
        Raises WorldError for an unknown scenario; ValueError for a network, for no name where there is not exactly one scenario, or for a
        loop that cannot be compiled; MemoryError for a run that is larger than the memory.
        """
        if self.stations:
            raise ValueError(f"{self.name} is a network: run() returns the run of each station")
        (run,) = self._runs(scenario)
        return run

    def run(self, scenario: Optional[str] = None) -> dict[str, Run]:
        """Runs a scenario of a network, by default its only one, and returns each station's run. `link_Nm` is its last column.

        Warnings and errors are those of `simulate`. A world is accepted too: its one station has the name "".
        """
        return dict(zip(self.stations or [""], self._runs(scenario)))

    def check(self, remedies: bool = True) -> Check:
        """Analyses stability and passivity and certifies them, with the changes that would certify a world that is not certified.

        `remedies=False` leaves the changes out and is faster. Raises ValueError where the analysis has no result.
        """
        if not isinstance(remedies, (bool, np.bool_)):
            raise TypeError(f"remedies must be True or False, not {remedies!r}")
        fields, text = self._native.check(bool(remedies))
        return Check(json.loads(fields), text)

    def impedance(
        self, low: Optional[Value] = None, high: Optional[Value] = None, points: int = 200, slopes: str = "steep"
    ) -> Impedance:
        """The impedance at the puck at `points` frequencies (1 to 100 000) from `low` to `high`, logarithmically spaced.

        The ends are strings with a unit or numbers in Hz. `high` is at most half of the sampling rate, which is the default. `slopes` is the
        slope that nonlinear couplings have: their "steep" or their "flat" one. Raises ValueError for other arguments, for a network, and where the analysis has no result.
        """
        if slopes not in ("steep", "flat"):
            raise ValueError(f'slopes is {slopes!r}, but must be "steep" or "flat"')
        whole("points", points, 1, _POINTS)
        from_, to = (None if end is None else text_of(end, name) for name, end in [("low", low), ("high", high)])
        columns, info = self._native.impedance(from_, to, points, slopes == "steep")
        return Impedance(columns, json.loads(info))

    def worst(self) -> Worst:
        """Searches for the passive hands, one at each station, that draw most energy from the loop.

        Raises ValueError where the search does not apply.

        >>> import hapt
        >>> broken = hapt.load("networks/pair.toml").set("links.0.age_max", "60 ms").worst()
        >>> broken["broken"], broken.world.scenarios
        (True, ['worst'])
        """
        fields, shown = self._native.worst()
        return Worst(json.loads(fields), None if shown is None else World._of(shown))

    def against(self, times: ArrayLike, positions: ArrayLike, torques: ArrayLike) -> Comparison:
        """Compares a record of a device's motion with this world's device, as `hapt identify LOG --against WORLD` does.

        The arrays are those of `hapt.identify`; their times are one period of the loop apart, within 5 %. A number contradicts the world
        where its estimate is more than four standard errors outside of the world's tolerance. Raises ValueError for a network, and for a
        record that determines nothing or is of a loop with another period.

        >>> import hapt, numpy as np
        >>> world, k = hapt.load("@notes/euler"), np.arange(1000)
        >>> device, torques, positions = world.device(), np.where(k // 170 % 2 == 0, 0.05, -0.04), []
        >>> for torque in torques:
        ...     positions.append(device.puck[0])
        ...     _ = device.step(torque)
        >>> record = 1e-3 * k, np.round(positions, 4), torques
        >>> world.against(*record)["agrees"]
        True
        >>> other = world.set("device.inertia", "7e-4 kg m^2").against(*record)
        >>> [number["name"] for number in other["numbers"] if number["verdict"] == "contradicts"]
        ['inertia']
        """
        arrays = _record(times, positions, torques)
        return Comparison(json.loads(self._native.against(*arrays)))

    # Parts

    def loop(self) -> Loop:
        """The loop without its device, for other simulators: `step(position, velocity) -> torque`. Raises ValueError for a network."""
        return Loop(self)

    def device(self, scenario: Optional[str] = None) -> Device:
        """The device without the loop, with the hand of `scenario` or without: `step(torque) -> (position, velocity)`.

        Raises WorldError for an unknown scenario, ValueError for a network or a scenario with uneven times.
        """
        return Device(self, scenario)

    def to_control(self) -> StateSpaces:
        """World, device and loop as state spaces of python-control.

        Raises ImportError without python-control, ValueError where the analysis has no result.
        """
        return state_spaces(self)

    def live(self, port: int = 0, program: Optional[str] = None) -> Live:
        """Starts `hapt live`: the loop in real time on the simulated device, with a page that a notebook shows.

        `port` is that of the page, 0 for a free one. `program` is the command's path, by default hapt found on the path. Raises
        FileNotFoundError without the command, ValueError for a network, RuntimeError where the command ends before it serves a page.
        """
        return Live(self.to_toml(), port, program)

    def widget(self, height: int = 720) -> Widget:
        """The world running on the simulated device under a notebook's cell: the page of `live` without a server and without the program.

        The loop runs in the browser. The certificate and the sliders' certified ranges are those of this world, before changes in the page.
        `height` is the frame's in pixels, 200 to 4000. Raises ValueError for another height, and for a world that the page cannot run.

        >>> import hapt
        >>> hapt.load('loop.period = "1 ms"\\ndevice.inertia = 6.4e-4').widget()
        <hapt.Widget of text>
        """
        whole("height", height, 200, 4000)
        return Widget(self._native.page(), self.name, height)

    def export_fmu(
        self, path: Union[str, os.PathLike[str]], fmi: int = 2, whole: bool = False, program: Optional[str] = None
    ) -> None:
        """Writes the loop as an FMU for other simulators with `hapt export fmu`; with `whole`, the loop together with its device.

        `fmi` is the version, 2 or 3. `program` is the command's path, by default hapt found on the path. Raises FileNotFoundError without the
        command, ValueError for a world that cannot be exported, OSError where the file cannot be written.
        """
        if fmi not in (2, 3):
            raise ValueError(f"fmi is {fmi!r}, but must be 2 or 3")
        words = ["export", "fmu", "-", "-o", os.fspath(path), "--fmi", str(fmi), *(["--whole"] if whole else [])]
        ran(program, words, self.to_toml())

    def _runs(self, scenario: Optional[str]) -> list[Run]:
        name = self._scenario(scenario)
        stations, ended = self._native.simulate(name)
        if ended is not None:
            warnings.warn(f"scenario {name}: {ended}", RuntimeWarning, stacklevel=3)
        return [Run(name, columns, summary, ended) for columns, summary in stations]

    def _scenario(self, name: Optional[str]) -> str:
        if name is not None:
            return a_scenario(name)
        names = self.scenarios
        if len(names) != 1:
            kind = "network" if self.stations else "world"
            raise ValueError(f"name a scenario: the {kind} has {', '.join(names)}" if names else f"the {kind} has no scenario to run")
        return names[0]


def load(source: Union[str, os.PathLike[str], Mapping[str, Any]]) -> World:
    """Reads a world or network from a file, a text or a dict.

    A str with a newline or an "=" is the text of a world file; another str is a path or the name of a built-in world (`"@notes/euler"`). A
    `pathlib.Path` is always a path. A dict has the tables of the file. The worlds of a network are in its file's folder or below it. Raises
    WorldError, with the line and a caret, for a mistake in it.

    >>> import hapt
    >>> hapt.load('loop.period = "1 kg"\\ndevice.inertia = 6.4e-4')
    Traceback (most recent call last):
        ...
    hapt.WorldError: loop.period: "1 kg" is a mass (kg); expected a time (s), such as "1 ms"
     --> text:1:15
      |
    1 | loop.period = "1 kg"
      |               ^^^^^^
    """
    if isinstance(source, Mapping):
        return World._of(_hapt.read("dict", _toml.document(_toml.plain(source, ""))))
    if isinstance(source, str) and ("\n" in source or "=" in source):
        return World._of(_hapt.read("text", source))
    path = os.fspath(source)
    if not isinstance(path, str):
        raise TypeError(f"a world is read from a str, a path or a dict, not from {type(source).__name__}")
    return World._of(_hapt.read(path, path=path))


def design(travel: Any, torque: Any, frequency: Any, period: Any = "1 ms") -> Design:
    """Designs the notes' wheel on a spring (section 2.1): stiffness, inertia and compensating damping for a travel, torque and frequency.

    `travel` is the angle at which the spring has the torque `torque`, `frequency` the natural frequency, `period` the loop's. Each is a
    string with a unit or a number in SI (rad, N·m, Hz, s) and positive. Raises ValueError for other values; warns with a RuntimeWarning where
    the damper does not balance forward Euler at this period.

    >>> import hapt
    >>> round(hapt.design("45 deg", "800 N mm", "1 Hz")["stiffness"], 4)
    1.0186
    """
    wanted = text_of(travel, "travel"), text_of(torque, "torque"), text_of(frequency, "frequency")
    fields, file, note = _hapt.design(*wanted, text_of(period, "period"))
    if note is not None:
        warnings.warn(note, RuntimeWarning, stacklevel=2)
    return Design(json.loads(fields), load(file))


def identify(
    times: ArrayLike, positions: ArrayLike, torques: ArrayLike, inertia: Optional[float] = None, linear: bool = False
) -> Identified:
    """Identifies a device from a record of its motion: arrays of one shape (n,), n >= 200, over at least half a second.

    `times` in s, rising; `positions` in rad (with `linear` m); `torques` in N·m (N), each commanded at its sample and held until the next.
    With a known `inertia` in kg·m² (kg) a record without torque (a coast-down) determines damping and friction. Raises ValueError for a
    record that determines nothing.
    """
    arrays = _record(times, positions, torques)
    known = None if inertia is None else float(numbers("inertia", [inertia])[0])
    if known is not None and known <= 0.0:
        raise ValueError(f"inertia is {known}, but must be above 0")
    fields, notes = _hapt.identify(arrays[0], arrays[1], arrays[2], known, bool(linear))
    return Identified(json.loads(fields), notes)


def _record(times: ArrayLike, positions: ArrayLike, torques: ArrayLike) -> list[NDArray[np.float64]]:
    return [numbers(name, values) for name, values in [("times", times), ("positions", positions), ("torques", torques)]]


def measures() -> dict[str, str]:
    """The measures of a sweep: their names with meaning and unit."""
    return {name: f"{meaning} ({unit})" if unit else meaning for name, unit, meaning in _hapt.measures()}


def _world(name: str, text: str, folder: Any, files: dict[str, str], sets: list[str]) -> World:
    return World._of(_hapt.read(name, text, folder, files, sets))
