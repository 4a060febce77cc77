"""Networks: stations that links join."""

from __future__ import annotations

import json
import os
import warnings
from typing import Any, Optional, Union

from . import _hapt, _toml
from ._analyses import WorstTogether
from ._answer import Certificate
from ._system import System, a_key
from ._table import Table


class NetworkCheck(Certificate):
    """The mapping of `hapt check --json` of a network (docs/contract.md, section 9); `print` shows it as `hapt check` does.

    Its truth is whether the network is certified: `assert network.check()`.
    """

    @property
    def certified(self) -> bool:
        """Every station is certified alone, and all are passive together, for any clocks and any loss."""
        return bool(self._fields["certified"])


class Network(System[_hapt.Network]):
    """Stations, each a world with its device, and links between their pucks. It never changes; `set` gives a changed copy.

    Read from a network file, whose worlds are in its folder or below it:

    >>> import hapt
    >>> network = hapt.Network.load("networks/pair.toml")
    >>> network.stations
    ['left', 'right']
    >>> network.check().certified
    True
    >>> softer = network.set("links.0.age_max", "60 ms").set("links.0.stiffness", 0.05)
    >>> softer.get("links.0.stiffness"), softer.check().certified
    (0.05, True)
    >>> network.run()["right"]["link_Nm"].shape
    (1001,)
    """

    _kind = "network"

    def __init__(self) -> None:
        raise TypeError("a network is read from its file: hapt.Network.load(path)")

    @classmethod
    def _of(cls, native: _hapt.Network) -> Network:
        network = cls.__new__(cls)
        network._native = native
        return network

    @classmethod
    def load(cls, path: Union[str, os.PathLike[str]]) -> Network:
        """A network from its file. Raises WorldError, with line and caret, for what the reader refuses in it or in a station's world."""
        return cls._of(_hapt.read_network(os.fspath(path), path=path))

    def set(self, key: str, value: Any) -> Network:
        """A copy in which `key` is `value`: "links.0.stiffness", or a station's, "stations.left.device.damping".

        A string has its unit ("2 ms"), a number is in SI. Raises WorldError for an unknown key or a value that the file would refuse.
        """
        value = _toml.plain(value, key)
        return Network._of(self._native.set(a_key(key), value if isinstance(value, str) else _toml.inline(value)))

    def get(self, key: str) -> Optional[float]:
        """The number of a key in SI; None where it is absent and has no default. Raises KeyError for a key that takes no number."""
        is_known, number = self._native.number(key)
        if not is_known:
            raise KeyError(f"the network has no number {key!r}; its keys are such as 'links.0.stiffness'")
        return number

    @property
    def name(self) -> str:
        """Its title, or else what it was read from."""
        return self._native.name

    @property
    def stations(self) -> list[str]:
        """The stations' names in file order."""
        return self._native.stations

    @property
    def scenarios(self) -> list[str]:
        """The scenarios' names: what its stations' worlds have."""
        return self._native.scenarios

    def __repr__(self) -> str:
        return f"<hapt.Network {self.name!r}: {', '.join(self.stations)}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_network, self._native.parts())

    def check(self) -> NetworkCheck:
        """The certificate, for any clocks and any loss within the links' ages, with remedies. Raises ValueError where it has no result."""
        fields, text = self._native.check()
        return NetworkCheck(json.loads(fields), text)

    def run(self, scenario: Optional[str] = None) -> dict[str, Table]:
        """Runs a scenario, the only one by default: of each station the columns of its CSV, `link_Nm` last, as arrays of shape (rows,).

        A run that stops being finite keeps its rows up to there, and warns. Raises ValueError for an unknown scenario, or where one must be
        named, MemoryError for a run larger than memory.
        """
        names = self.scenarios
        if scenario is None and len(names) != 1:
            there = f"there are {', '.join(names)}: name one" if names else "no station's world has one"
            raise ValueError(f"which scenario? {there}")
        name = names[0] if scenario is None else scenario
        stations, ended = self._native.run(name)
        if ended is not None:
            warnings.warn(f"scenario {name}: {ended}", RuntimeWarning, stacklevel=2)
        return {station: Table(columns) for station, columns in stations.items()}

    def worst(self) -> WorstTogether:
        """Searches for the passive hands, one at each station, that draw most energy together; some seconds.

        Raises ValueError where there is no answer.

        >>> import hapt
        >>> broken = hapt.Network.load("networks/pair.toml").set("links.0.age_max", "60 ms").worst()
        >>> broken["broken"], broken.network.scenarios
        (True, ['worst'])
        """
        fields, shown = self._native.worst()
        return WorstTogether(json.loads(fields), Network._of(shown))


def _network(name: str, text: str, folder: Any, files: dict[str, str], sets: list[str]) -> Network:
    return Network._of(_hapt.read_network(name, text, folder, files, sets))
