"""Networks of stations."""

from __future__ import annotations

import pickle
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
    return hapt.load(tmp_path / "pair.toml")


def test_a_network_is_certified_up_to_its_bound(pair: hapt.World) -> None:
    check = pair.check()
    assert check and list(check["stations"]) == pair.stations == ["left", "right"]
    # K (T/2 + age_max)
    assert check["stations"]["left"]["required_damping"] == pytest.approx(0.2 * 20.5e-3, rel=1e-12)
    assert str(check).startswith("Certified: ")
    weak = pair.set("stations.right.device.damping", 1e-4)
    assert not weak.check() and weak.get("stations.right.device.damping") == 1e-4
    assert pair.get("stations.right.device.damping") == 0.01, "a network never changes"
    assert pair.set("links.0.age_max", "5 ms").get("links.0.age_max") == 5e-3
    assert pair.get("links.0.limit") is None


def test_a_network_is_a_world_with_stations_and_links(pair: hapt.World) -> None:
    assert isinstance(pair, hapt.World) and pair.stations == ["left", "right"] and pair.links == [("left", "right")]
    assert pair.get("stations.right.loop.method") and pair.get("stations.left.phase") == 0
    assert pair == pair.set("links.0.stiffness", 0.2) != pair.set("links.0.stiffness", 0.3)
    single = hapt.load(WHEEL)
    assert single.stations == [] and single.links == [] and single.run()[""] == single.simulate()
    with pytest.raises(ValueError, match="is a network"):
        pair.loop()


def test_a_run_has_the_columns_of_each_station(pair: hapt.World) -> None:
    run = pair.run()
    left, right = run["left"], run["right"]
    assert left["time_s"].shape == (201,) and right["time_s"].shape == (101,)
    assert list(right)[-1] == "link_Nm"
    # The link's torque pulls the free wheel toward the held one, and never beyond its stiffness times the step.
    assert 0 < np.abs(right["link_Nm"]).max() <= 0.2 * np.radians(10) * (1 + 1e-9)
    assert right["puck_rad"][-1] > 0


def test_mistakes_name_their_place(pair: hapt.World, tmp_path: Path) -> None:
    with pytest.raises(hapt.WorldError, match="links.0.stifness: unknown key"):
        pair.set("links.0.stifness", 1)
    with pytest.raises(hapt.WorldError, match='no station "up"'):
        pair.set("stations.up.loop.period", "2 ms")
    with pytest.raises(KeyError, match="links.1.stiffness"):
        pair.get("links.1.stiffness")
    with pytest.raises(ValueError, match='no station\'s world has a scenario "pull"'):
        pair.run("pull")
    with pytest.raises(hapt.WorldError):
        hapt.load(tmp_path / "none.toml")
    with pytest.raises(ValueError, match="is a network"):
        pair.simulate()


def test_the_edge_of_a_pair_is_that_of_the_shared_burden(pair: hapt.World) -> None:
    edge = pair.boundary({"links.0.stiffness": (0.05, 1.0), "links.0.age_max": ("5 ms", "60 ms")}, "passive")
    assert edge.keys == ("links.0.stiffness", "links.0.age_max") and len(edge.pieces) == 1
    piece = edge.pieces[0]
    # b = K (T/2 + c A) at the left and K (T'/2 + A/c) at the right, of some c
    left, right = (0.01 / piece.x - period / 2 for period in (1e-3, 2e-3))
    assert np.sqrt(left * right) == pytest.approx(piece.y, rel=1e-3)
    assert list(edge.to_pandas().columns) == ["edge", "piece", "links.0.stiffness", "links.0.age_max", "hz"]


def test_a_claim_without_a_verdict_has_its_reason(pair: hapt.World) -> None:
    lossy = pair.set("links.0.loss", 0.1)
    edges = lossy.boundary({"links.0.stiffness": (0.05, 1.0), "links.0.age_max": ("5 ms", "60 ms")})
    assert edges.everywhere["fixed"] is None and list(edges.undecided) == ["fixed"] and "lost" in edges.undecided["fixed"]
    assert {piece.claim for piece in edges.pieces} == {"passive"}


def test_a_sweep_agrees_with_the_certificate(pair: hapt.World, tmp_path: Path) -> None:
    ages, measures = np.array([5e-3, 20e-3, 80e-3]), ["certified", "damping_margin", "peak_torque"]
    sweep = pair.sweep({"links.0.age_max": ages, "stations.left.device.damping": [4e-3, 1e-2]}, measures, progress=False)
    assert sweep["certified"].shape == (3, 2)
    for i, age in enumerate(ages):
        check = pair.set("links.0.age_max", age).check()
        assert bool(sweep["certified"][i, 1]) == check.certified == (sweep["damping_margin"][i, 1] >= 0)
    run = pair.set("links.0.age_max", 5e-3).run()
    assert sweep["peak_torque"][0, 1] == max(np.abs(run[name]["torque_Nm"] + run[name]["link_Nm"]).max() for name in run)
    shards = pair.sweep(sweep.axes, measures, out=tmp_path / "table", shards=2, progress=False).to_pandas()
    assert shards.equals(sweep.to_pandas())


def test_the_worst_hands_of_a_broken_network_play_in_it(pair: hapt.World) -> None:
    weak = pair.set("links.0.age_max", "60 ms").set("stations.left.device.damping", 1e-3).set("stations.right.device.damping", 1e-3)
    worst = weak.worst()
    assert worst["broken"] and not worst["certified"] and worst["drawn"]["gain"] > 0
    assert worst.world is not None and worst.world.scenarios == ["worst"] and not worst.world.check()
    copy = pickle.loads(pickle.dumps(worst))
    run = copy.world.run()
    # The hands begin when the links have taken hold.
    left = run["left"]
    assert np.abs(left["puck_rad"][left["time_s"] < worst["begins_s"]]).max() < 1e-9 < np.abs(left["puck_rad"]).max()
    assert run["right"] == worst.world.run()["right"]


def test_networks_can_be_pickled(pair: hapt.World) -> None:
    softer = pickle.loads(pickle.dumps(pair.set("links.0.stiffness", 0.05)))
    assert softer.get("links.0.stiffness") == 0.05 and dict(softer.check()) == dict(pair.set("links.0.stiffness", 0.05).check())


def test_what_is_not_of_a_network_is_refused(pair: hapt.World) -> None:
    plane = {"links.0.stiffness": (0.05, 1.0), "links.0.age_max": (5e-3, 60e-3)}
    with pytest.raises(ValueError, match="held"):
        pair.boundary(plane, "held")
    with pytest.raises(ValueError, match="required_damping"):
        pair.sweep({"links.0.age_max": [0.01]}, "required_damping")
    with pytest.raises(hapt.WorldError, match="age_max"):
        pair.sweep({"links.0.age_max": [-0.01]}, "certified")
    with pytest.raises(hapt.WorldError):
        pair.boundary({"links.0.stiffness": (0.05, 1.0), "stations.up.loop.period": (5e-3, 60e-3)})
    with pytest.raises(ValueError, match="'='"):
        pair.set("links.0.stiffness=1", 2)
