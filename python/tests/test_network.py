"""Networks of stations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hapt

WHEEL = """
loop.period = "1 ms"
device = { inertia = 1e-3, damping = 0.01 }
[scenarios.push]
duration = "0.2 s"
hand = { kind = "step", to = "10 deg", at = "20 ms" }
"""
PAIR = """
stations.left.world = "wheel.toml"
stations.right.world = "free.toml"
[[links]]
kind = "spring"
between = ["left", "right"]
stiffness = 0.2
age_max = "20 ms"
"""


@pytest.fixture
def pair(tmp_path: Path) -> hapt.Network:
    (tmp_path / "wheel.toml").write_text(WHEEL)
    (tmp_path / "free.toml").write_text(WHEEL.split("[scenarios")[0].replace("1 ms", "2 ms"))
    (tmp_path / "pair.toml").write_text(PAIR)
    return hapt.Network.load(tmp_path / "pair.toml")


def test_a_network_is_certified_up_to_its_bound(pair: hapt.Network) -> None:
    check = pair.check()
    assert check and list(check["stations"]) == pair.stations == ["left", "right"]
    # K (T/2 + age_max)
    assert check["stations"]["left"]["required_damping"] == pytest.approx(0.2 * 20.5e-3, rel=1e-12)
    assert "verdict   certified" in str(check)
    weak = pair.set("stations.right.device.damping", 1e-4)
    assert not weak.check() and weak.get("stations.right.device.damping") == 1e-4
    assert pair.get("stations.right.device.damping") == 0.01, "a network never changes"
    assert pair.set("links.0.age_max", "5 ms").get("links.0.age_max") == 5e-3
    assert pair.get("links.0.limit") is None


def test_a_run_has_the_columns_of_each_station(pair: hapt.Network) -> None:
    run = pair.run()
    left, right = run["left"], run["right"]
    assert left["time_s"].shape == (201,) and right["time_s"].shape == (101,)
    assert list(right)[-1] == "link_Nm"
    # The link's torque pulls the free wheel toward the held one, and never beyond its stiffness times the step.
    assert 0 < np.abs(right["link_Nm"]).max() <= 0.2 * np.radians(10) * (1 + 1e-9)
    assert right["puck_rad"][-1] > 0


def test_mistakes_name_their_place(pair: hapt.Network, tmp_path: Path) -> None:
    with pytest.raises(hapt.WorldError, match="links.0.stifness: unknown key"):
        pair.set("links.0.stifness", 1)
    with pytest.raises(hapt.WorldError, match='no station "up"'):
        pair.set("stations.up.loop.period", "2 ms")
    with pytest.raises(KeyError, match="links.1.stiffness"):
        pair.get("links.1.stiffness")
    with pytest.raises(ValueError, match='no station\'s world has a scenario "pull"'):
        pair.run("pull")
    with pytest.raises(hapt.WorldError):
        hapt.Network.load(tmp_path / "none.toml")
    with pytest.raises(TypeError, match="Network.load"):
        hapt.Network()
