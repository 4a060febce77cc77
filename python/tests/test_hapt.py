"""The package is the crates' face: names, numbers and errors are theirs."""

import copy
import csv
import dataclasses
import html.parser
import inspect
import io
import os
import pickle
import pathlib
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from typing import Any, Optional, get_args, get_origin, get_type_hints

import hapt
import numpy as np
import pytest

from conftest import WALL


def test_a_text_a_file_and_a_dict_are_the_same_world(world: hapt.World, tmp_path: pathlib.Path) -> None:
    file = tmp_path / "wall.toml"
    file.write_text(WALL)
    table: dict[str, Any] = {
        "loop": {"period": "1 ms"},
        "device": {"inertia": "6.4e-4 kg m^2", "damping": np.float32(0) + np.float64(1.2e-3)},
        "couplings": [{"kind": "spring", "between": ["puck", "ground"], "stiffness": 2}],
        "scenarios": {"step": {"duration": 0.5, "hand": hapt.Step("10 deg", release=0.1)}},
    }
    assert hapt.load(file) == hapt.load(str(file)) == hapt.load(table) == world
    built = hapt.World(
        loop=table["loop"],
        device=table["device"],
        couplings=[hapt.Spring(("puck", "ground"), "2 N m/rad")],
        scenarios={"step": {"duration": "500 ms", "hand": hapt.Step("10 deg", release="100 ms")}},
    )
    assert built == world


def test_every_table_of_a_world_file_is_one_of_the_constructor() -> None:
    torque = {"torque": "20 N mm", "phase": "30 deg"}
    plain = hapt.World(loop={"period": 1e-3}, device={"inertia": 1e-3, "gravity": torque})
    held = hapt.World(loop={"period": 1e-3}, device={"inertia": 1e-3, "gravity": torque}, compensation=[{"of": "gravity"}])
    for world, expected in [(plain, 0.0), (held, -0.02 * np.sin(np.deg2rad(30)))]:
        assert world.loop().step(0.0, 0.0) == pytest.approx(expected)
    tables = {key.split(".")[0] for key in hapt.load("@notes/default").parameters()}
    assert tables | {"compensation"} <= set(inspect.signature(hapt.World).parameters)


@pytest.mark.parametrize("title", ["2024", "1_0", "nan", "1e3", "true", "A wheel"])
def test_a_text_stays_a_text_and_a_whole_number_whole(title: str) -> None:
    world = hapt.load({"title": title, "loop": {"period": 1}, "device": {"inertia": 1, "encoder": 4000.0}})
    assert world.get("title") == world.parameters()["title"] == title
    assert [type(world.get(key)) for key in ("loop.period", "device.encoder", "loop.advance")] == [float, int, int]


def test_every_kind_of_the_reader_has_its_class_with_the_same_keys() -> None:
    for classes, keys in [
        (hapt._build.COUPLINGS, hapt._hapt.coupling_keys()),
        (hapt._build.HANDS, hapt._hapt.hand_keys()),
    ]:
        ours = {made.kind: {field.name for field in dataclasses.fields(made)} for made in classes}
        assert ours == {kind: set(names) - {"kind"} for kind, names in keys}


def is_of(value: Any, kind: Any) -> bool:
    """Whether a value of a command's JSON is of a type of the package, with all of its keys and no other."""
    if kind is Any:
        return True
    if hasattr(kind, "__total__"):
        hints = get_type_hints(kind)
        return isinstance(value, dict) and set(value) == set(hints) and all(is_of(value[key], hints[key]) for key in hints)
    if get_origin(kind) is list:
        return isinstance(value, list) and all(is_of(one, get_args(kind)[0]) for one in value)
    if get_args(kind):
        return any(is_of(value, one) for one in get_args(kind))
    return isinstance(value, (int, float) if kind is float else kind) and not (isinstance(value, bool) and kind is not bool)


@pytest.mark.parametrize("path", sorted(pathlib.Path("worlds").rglob("*.toml")), ids=str)
def test_the_types_of_a_check_are_those_of_its_json(path: pathlib.Path) -> None:
    checked = hapt.load(path).check(remedies=False)
    kinds = {name: get_type_hints(of.fget)["return"] for name, of in vars(hapt.Check).items() if isinstance(of, property)}
    wrong = [name for name, kind in kinds.items() if not is_of(checked[name], kind)]
    assert not wrong, {name: checked[name] for name in wrong}


def test_set_takes_units_and_numbers_and_changes_nothing_else(world: hapt.World) -> None:
    for value in ["2 ms", 0.002, np.float64(0.002), np.float32(0.002)]:
        assert world.set("loop.period", value).get("loop.period") == pytest.approx(0.002)
    assert world.get("loop.period") == 0.001
    assert world.set("device.encoder", np.int64(4000)).get("device.encoder") == 4000
    assert world.get("loop.method") == "zoh" and world.get("device.limit") is None
    many = world
    for i in range(1100):
        many = many.set("loop.period", 0.001 + i * 1e-6)
    assert many.get("loop.period") == pytest.approx(0.002099)


@pytest.mark.parametrize(
    ("key", "value", "error"),
    [
        ("loop.period", "2 kg", hapt.WorldError),
        ("loop.perod", "2 ms", hapt.WorldError),
        ("loop.period", float("nan"), hapt.WorldError),
        ("loop.period", float("inf"), hapt.WorldError),
        ("loop.period", [1], hapt.WorldError),
        ("loop.period", b"1 ms", TypeError),
        ("loop.period", object(), TypeError),
        ("loop.period", 1j, TypeError),
        (3, "2 ms", TypeError),
        ("loop.period=1ms\nx", "2 ms", ValueError),
        ("a." * 5000, 1, hapt.WorldError),
        ("", 1, hapt.WorldError),
    ],
)
def test_a_wrong_change_is_an_error_of_python(world: hapt.World, key: object, value: object, error: type) -> None:
    with pytest.raises(error):
        world.set(key, value)  # type: ignore[arg-type]


def test_an_error_has_line_and_caret() -> None:
    with pytest.raises(hapt.WorldError) as caught:
        hapt.load('[loop]\nperiod = "1 kg"\n')
    error = caught.value
    assert isinstance(error, ValueError)
    assert (error.key, error.line, error.column, error.kind) == ("loop.period", 2, 10, "value")
    assert '2 | period = "1 kg"\n  |          ^^^^^^' in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) and again.line == 2
    with pytest.raises(KeyError, match="loop.period"):
        hapt.load(WALL).get("loop.perod")
    with pytest.raises(hapt.WorldError, match="cannot read"):
        hapt.load("no/such/file.toml")
    for wrong in [3, None, ["a"], b"x"]:
        with pytest.raises(TypeError):
            hapt.load(wrong)  # type: ignore[arg-type]


def test_a_run_has_the_columns_of_the_csv(world: hapt.World) -> None:
    run = world.simulate("step")
    assert list(run) == [
        "time_s", "puck_rad", "puck_rad_per_s", "measured_rad", "measured_rad_per_s", "torque_Nm", "command_Nm", "applied_Nm",
    ]  # fmt: skip
    assert len(run["time_s"]) == 501 and run["torque_Nm"].dtype == np.float64
    assert run.summary["peak_torque"] == np.abs(run["torque_Nm"]).max() == pytest.approx(2 * np.radians(10))
    assert run.time[-1] == 0.5 and run["torque_Nm"].flags.c_contiguous
    assert pickle.loads(pickle.dumps(run)) == run == copy.deepcopy(run)
    with pytest.raises(KeyError, match="torque_Nm"):
        run["torque"]
    with pytest.raises(hapt.WorldError, match="step"):
        world.simulate("stop")


def test_a_run_becomes_a_frame(world: hapt.World) -> None:
    pandas = pytest.importorskip("pandas")
    run = world.simulate()
    frame = run.to_pandas()
    assert list(frame) == list(run) and isinstance(frame, pandas.DataFrame)
    read = list(csv.reader(io.StringIO(frame.to_csv(index=False))))
    assert read[0] == list(run) and float(read[1][1]) == run["puck_rad"][0]


def test_tables_go_to_arrow_with_null_for_what_is_missing(world: hapt.World) -> None:
    arrow = pytest.importorskip("pyarrow")
    run = world.simulate()
    table = arrow.table(run)
    assert table.column_names == list(run)
    assert all(np.array_equal(table[name].to_numpy(), run[name]) for name in run)
    sweep = world.sweep(
        {"couplings.0.stiffness": [1.0, 2.0], "device.damping": [1e-3, 2e-3, 3e-3]}, ["settling_time", "certified"]
    )
    table = arrow.table(sweep)
    assert table.column_names == ["couplings.0.stiffness", "device.damping", "settling_time", "certified"]
    assert table["device.damping"].to_pylist() == [1e-3, 2e-3, 3e-3] * 2
    missing = np.isnan(sweep["settling_time"].ravel())
    assert table["settling_time"].is_null().to_pylist() == missing.tolist() and missing.any()


def test_a_run_becomes_a_dataset(world: hapt.World) -> None:
    pytest.importorskip("xarray")
    data = world.simulate().to_xarray()
    assert data.sizes == {"time_s": 501} and data.attrs["rows"] == 501


def test_a_run_that_stops_being_finite_keeps_its_rows() -> None:
    world = hapt.load(WALL).set("couplings.0.stiffness", 1e7).set("scenarios.step.duration", "10 s")
    with pytest.warns(RuntimeWarning, match="stops being finite"):
        run = world.simulate()
    assert run.ended is not None and 100 < len(run["time_s"]) < 10001
    assert all(np.isfinite(column).all() for column in run.values())


def test_a_run_larger_than_memory_is_refused() -> None:
    world = hapt.load(WALL).set("loop.period", 1e-7).set("scenarios.step.duration", 900)
    try:
        limit = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError):
        pytest.skip("this system does not tell its memory")
    if limit < 9 * 10**9 * 8 * 8:
        with pytest.raises(MemoryError, match="GiB"):
            world.simulate()


def test_a_check_is_the_contract_s_mapping(world: hapt.World) -> None:
    check = world.check()
    assert check.certified and check and check["certified"] is True
    assert set(check) == {
        "period_s", "method", "output", "held", "free", "passivity", "uneven", "quantisation", "remedies", "certified", "status", "theorems", "notes",
    }  # fmt: skip
    assert check.passivity["required_damping"] == pytest.approx(1e-3)  # KT/2
    assert check.uneven["free"]["verdict"] == "proved" and check.uneven["free"]["pattern"] is None
    broken = world.set("loop.interval_max", "1.8 ms").set("couplings.0.stiffness", "2 N m/rad").set("device.damping", 1e-3)
    pattern = broken.check().uneven["free"]["pattern"]
    assert pattern is not None and pattern["growth_per_s"] > 0 and pattern["intervals_s"] == [1.8e-3]
    assert "passive" in str(check) and "margins" in str(check)
    assert "certified" in check._repr_html_()
    assert world.check(remedies=False)["remedies"] is None
    assert dict(pickle.loads(pickle.dumps(check))) == dict(check)
    refused = world.set("couplings.0.stiffness", "20 N m/rad").check()
    assert not refused and "remedies" in str(refused)


def test_a_sweep_has_an_axis_for_each_key(world: hapt.World) -> None:
    stiffness = np.array([3.0, 1.0, 2.5])
    sweep = world.sweep({"couplings.0.stiffness": stiffness, "loop.period": [1e-3, 2e-3]}, ["required_damping", "certified"])
    expected = stiffness[:, None] * np.array([1e-3, 2e-3]) / 2
    assert sweep["required_damping"] == pytest.approx(expected)
    assert np.array_equal(sweep["certified"], expected <= 1.2e-3)
    peak = world.sweep({"couplings.0.stiffness": stiffness}, "peak_torque", progress=False, threads=1)
    single = [world.set("couplings.0.stiffness", k).simulate().summary["peak_torque"] for k in stiffness]
    assert np.array_equal(peak["peak_torque"], single)


def test_a_sweep_refuses_what_is_no_axis(world: hapt.World) -> None:
    frozen = np.linspace(1e-3, 2e-3, 6)
    frozen.flags.writeable = False
    assert world.sweep({"loop.period": frozen[::2]}, "certified")["certified"].shape == (3,)
    refused: list[tuple[Any, type[Exception]]] = [
        ([1e-3, np.nan], ValueError),
        ([], ValueError),
        ([[1e-3]], ValueError),
        (["1 ms"], TypeError),
        ([1j], TypeError),
        ([-1.0], hapt.WorldError),
    ]
    for values, error in refused:
        with pytest.raises(error):
            world.sweep({"loop.period": values}, "certified")
    with pytest.raises(ValueError, match="certified"):
        world.sweep({"loop.period": [1e-3]}, "certifed")
    with pytest.raises(ValueError):
        world.sweep({"loop.perod": [1e-3]}, "certified")
    with pytest.raises(ValueError):
        world.sweep({"device.encoder": [4000.5]}, "certified")


def test_the_loop_and_the_device_together_are_a_run(world: hapt.World) -> None:
    world = world.set("device.encoder", 4000).set("loop.estimator", "foaw").set("loop.window", 8).set("loop.delay", "0.4 ms")
    run = world.simulate()
    loop, device = world.loop(), world.device("step")
    torques = []
    position, velocity = device.puck
    for k in range(len(run.time)):
        torques.append(loop.step(position, velocity))
        assert loop.measured[0] == run["measured_rad"][k]
        position, velocity = device.step(loop.command)
        if k == 150:
            loop, device = pickle.loads(pickle.dumps((loop, device)))
        if k == 250:
            loop, device = copy.copy(loop), copy.deepcopy(device)
    assert np.array_equal(torques, run["torque_Nm"])
    loop.reset()
    assert loop.step(0.0) == 0.0
    for wrong in [np.nan, np.inf]:
        with pytest.raises(ValueError):
            loop.step(wrong)
        with pytest.raises(ValueError):
            device.step(wrong)
    with pytest.raises(TypeError, match="position"):
        loop.step("1")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="torque"):
        device.step("1")  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [None, 0.8])
def test_a_loop_that_stops_being_finite_raises_as_a_run_ends(world: hapt.World, limit: Optional[float]) -> None:
    far = world if limit is None else world.set("device.limit", limit)
    loop = far.loop()
    with pytest.raises(OverflowError, match="finite"):
        loop.step(1e308)  # 2 N·m/rad · 1e308 rad: no number has room for it, whatever the motor's limit is.
    loop.reset()
    assert loop.step(1e300) == -2e300 and loop.command == (-2e300 if limit is None else -limit)
    device = far.device()
    with pytest.raises(OverflowError, match="finite"):
        for _ in range(3):
            device.step(1e308)
    device.reset()
    assert device.step(0.0) == (0.0, 0.0)


def test_a_wrong_choice_is_named(world: hapt.World) -> None:
    axes, plane = {"loop.period": [1e-3]}, {"loop.period": (1e-3, 2e-3), "device.damping": (0.0, 1.0)}
    mistakes: list[tuple[str, Callable[[Any], object]]] = [
        ("remedies", lambda wrong: world.check(wrong)),
        ("scenario", lambda wrong: world.simulate(wrong)),
        ("scenario", lambda wrong: world.device(wrong)),
        ("scenario", lambda wrong: world.sweep(axes, "certified", wrong)),
        ("measures", lambda wrong: world.sweep(axes, wrong)),
        ("measures", lambda wrong: world.sweep(axes, [wrong])),
        ("claims", lambda wrong: world.boundary(plane, wrong)),
        ("claims", lambda wrong: world.boundary(plane, [wrong])),
        ("couplings", lambda wrong: hapt.World(loop={}, device={}, couplings=wrong)),
        ("compensation", lambda wrong: hapt.World(loop={}, device={}, compensation=wrong)),
    ]
    for name, call in mistakes:
        with pytest.raises(TypeError, match=name):
            call(1)


def test_a_handle_on_a_shaft_has_columns_and_a_motion_of_its_own(world: hapt.World) -> None:
    shaft = hapt.load(WALL + '[device.handle]\ninertia = "2e-4 kg m^2"\nstiffness = "20 N m/rad"\n')
    run = shaft.simulate()
    assert "handle_rad" not in world.simulate() and np.any(run["handle_rad"] != run["puck_rad"])
    loop, device = shaft.loop(), shaft.device("step")
    assert world.device("step").handle is None and device.handle == (run["handle_rad"][0], run["handle_rad_per_s"][0])
    for k in range(len(run.time) - 1):
        loop.step(*device.puck)
        device.step(loop.command)
        if k == 150:
            device = pickle.loads(pickle.dumps(device))
    assert device.handle == (run["handle_rad"][-1], run["handle_rad_per_s"][-1])


def test_worlds_pickle_with_their_changes(world: hapt.World) -> None:
    changed = world.set("loop.period", "2 ms")
    again = pickle.loads(pickle.dumps(changed))
    assert again == changed != world and again.get("loop.period") == 0.002


def test_the_impedance_of_a_spring_is_its_stiffness(world: hapt.World) -> None:
    impedance = world.impedance(points=50)
    assert impedance["stiffness_Nm_per_rad"][0] == pytest.approx(2.0, rel=1e-3)
    assert impedance.info["nyquist_hz"] == 500 and len(impedance["frequency_hz"]) == 50
    refused: list[dict[str, Any]] = [{"points": 0}, {"low": 600.0}, {"high": 1e9}, {"low": float("nan")}, {"slopes": "x"}]
    for wrong in refused:
        with pytest.raises(ValueError):
            world.impedance(**wrong)


def test_the_boundary_of_a_spring_is_twice_the_damping_over_the_period(world: hapt.World) -> None:
    ranges = {"couplings.0.stiffness": (1.0, 5.0), "device.damping": ("5e-4 N m s/rad", "3e-3 N m s/rad")}
    boundary = world.boundary(ranges, "passive")
    assert len(boundary.pieces) == 1 and boundary.everywhere == {"passive": None} and boundary.lost == {"passive": []}
    piece = boundary.pieces[0]
    assert piece.x * 1e-3 / 2 == pytest.approx(piece.y, rel=1e-3)
    with pytest.raises(ValueError):
        world.boundary({"loop.period": (1e-3, 2e-3)})
    with pytest.raises(ValueError):
        world.boundary(ranges, "pasive")


def test_the_worst_hand_breaks_what_is_not_certified(world: hapt.World) -> None:
    worst = world.set("couplings.0.stiffness", 10).worst()
    assert worst["broken"] and not worst["certified"]
    assert worst.world is not None and worst.world.scenarios == ["worst"]
    worst.world.simulate()


def test_a_record_gives_the_device_back(world: hapt.World) -> None:
    k = np.arange(3000)
    torques = np.where((k // 170) % 2 == 0, 0.05, -0.04)
    device = world.device()
    positions = []
    for torque in torques:
        positions.append(device.puck[0])
        device.step(torque)
    noisy = np.array(positions) + np.random.default_rng(1).normal(0, 1e-4, len(k))
    found = hapt.identify(k * 1e-3, noisy, torques)
    assert found["inertia"]["low"] < 6.4e-4 < found["inertia"]["high"]
    best = found["misfit"]["fit"]
    assert found["misfit"]["share"] < 0.05 and abs(best["inertia"] / 6.4e-4 - 1) < 0.1
    record = k * 1e-3, noisy, torques
    assert world.against(*record) and world.against(*record)["misfit"] is None
    for key, value, name in [("device.inertia", 7e-4, "inertia"), ("device.damping", 2e-3, "damping"), ("loop.delay", 4e-4, "delay")]:
        other = world.set(key, value).against(*record)
        wrong = {number["name"]: number for number in other["numbers"] if number["verdict"] == "contradicts"}
        assert not other and not other["agrees"] and wrong[name]["sigmas"] > 4
        assert wrong[name]["file"] == {"low": value, "high": value}
    with pytest.raises(ValueError, match="loop.period"):
        world.set("loop.period", "2 ms").against(*record)
    with pytest.raises(ValueError, match="finite"):
        hapt.identify(k * 1e-3, np.full(3000, np.nan), torques)
    with pytest.raises(ValueError):
        hapt.identify([0.0], [0.0], [0.0])


def test_a_design_is_a_world_with_the_torque_of_its_specification() -> None:
    design = hapt.design("30 deg", "500 N mm", "2 Hz", "2 ms")
    world = design.world
    assert world.get("couplings.0.stiffness") == design["stiffness"] and world.get("loop.period") == 0.002
    assert world.set("device.encoder", 10**9).simulate().summary["peak_torque"] == pytest.approx(0.5, rel=2e-3)


def test_design_takes_units_and_numbers() -> None:
    assert dict(hapt.design("45 deg", "800 N mm", "1 Hz")) == pytest.approx(dict(hapt.design(np.pi / 4, 0.8, 1, 1e-3)))
    for wrong in ["0 deg", "45 N", "", float("nan")]:
        with pytest.raises(ValueError):
            hapt.design(wrong, "800 N mm", "1 Hz")


def test_a_range_that_the_file_refuses_is_named_by_its_call(world: hapt.World) -> None:
    wide = {"device.damping": (1e-3, 2e-3), "loop.period": ("1 ms", "2e30 s")}
    with pytest.raises(hapt.WorldError) as raised:
        world.boundary(wide)
    assert " --> boundary:1:" in str(raised.value)


def test_a_design_that_does_not_balance_the_method_warns() -> None:
    with pytest.warns(RuntimeWarning, match="no longer balances forward Euler"):
        design = hapt.design("45 deg", "800 N mm", "1 Hz", "0.4 s")
    assert design.world.get("loop.period") == 0.4


def test_the_frequencies_of_an_impedance_take_units_and_numbers(world: hapt.World) -> None:
    with_units = world.impedance("0.5 Hz", "0.04 kHz", points=5)
    assert (with_units["frequency_hz"] == world.impedance(0.5, np.float64(40), points=5)["frequency_hz"]).all()


@pytest.mark.skipif(shutil.which("hapt") is None, reason="the program hapt is not on the path")
def test_numbers_and_refusals_are_those_of_the_command_line(world: hapt.World, tmp_path: pathlib.Path) -> None:
    file = tmp_path / "w.toml"
    file.write_text(world.to_toml())

    def command(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(["hapt", *words], capture_output=True, text=True, check=False)

    wheel = ["--travel", "0.5", "--torque", "0.3 N m", "--frequency", "2 Hz"]
    assert hapt.load(command("design", *wheel).stdout) == hapt.design(0.5, "0.3 N m", "2 Hz").world
    for low, high in [("0", "10"), ("20", "10"), ("1 ms", "10"), ("1", "600"), ("1", "1e400")]:
        refused = command("impedance", str(file), "--from", low, "--to", high).stderr.strip()
        with pytest.raises(ValueError) as raised:
            world.impedance(low, high)
        assert refused.replace("--from", "low").replace("--to", "high") == f"hapt: {raised.value}"
    for travel, torque in [("0", "1 N m"), ("1 kg", "1 N m"), ("1e-9 deg", "1e25 N m")]:
        refused = command("design", f"--travel={travel}", f"--torque={torque}", "--frequency=1e-9 Hz").stderr.strip()
        with pytest.raises(ValueError) as raised:
            hapt.design(travel, torque, "1e-9 Hz")
        assert refused.replace("--", "") == f"hapt: {raised.value}"


def test_responses_draw_themselves(world: hapt.World) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    assert world.simulate().plot().shape == (2,)
    stiffness = {"couplings.0.stiffness": [1.0, 2.0]}
    assert world.sweep(stiffness, "certified").plot().get_xlabel() == "couplings.0.stiffness"
    world.sweep({**stiffness, "loop.period": [1e-3, 2e-3, 3e-3]}, "certified").plot()
    world.impedance().plot("damping")
    with pytest.raises(ValueError):
        world.impedance().plot("colour")
    import matplotlib.pyplot as plt

    plt.close("all")


def test_a_widget_is_a_page_in_a_frame_that_requests_nothing(world: hapt.World) -> None:
    widget = world.set("loop.period", "2 ms").widget(height=500)
    frame = widget._repr_html_()
    parser = Frame()
    parser.feed(frame)
    assert parser.tags == ["iframe"] and parser.srcdoc == widget.html
    assert 'height="500"' in frame and "allow-same-origin" not in frame
    assert "loop.period=2 ms" in widget.html and "default-src 'none'" in widget.html
    for elsewhere in ["<link", " src=", "@import"]:
        assert elsewhere not in widget.html
    assert pickle.loads(pickle.dumps(widget)).html == widget.html
    for height in [100, 4001, 1.5]:
        with pytest.raises(ValueError, match="whole number from 200 to 4000"):
            world.widget(height)  # type: ignore[arg-type]


class Frame(html.parser.HTMLParser):
    """What a notebook makes of a frame."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.srcdoc: Optional[str] = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, Optional[str]]]) -> None:
        self.tags.append(tag)
        self.srcdoc = dict(attrs).get("srcdoc")


def test_live_and_export_need_the_program(world: hapt.World, tmp_path: pathlib.Path) -> None:
    with pytest.raises(FileNotFoundError):
        world.live(program="/no/such/hapt")
    with pytest.raises(FileNotFoundError):
        world.export_fmu(tmp_path / "w.fmu", program="/no/such/hapt")
    with pytest.raises(ValueError, match="2 or 3"):
        world.export_fmu(tmp_path / "w.fmu", fmi=1)


@pytest.mark.skipif(shutil.which("hapt") is None, reason="the program hapt is not on the path")
def test_an_fmu_is_the_command_s(world: hapt.World, tmp_path: pathlib.Path) -> None:
    try:
        world.export_fmu(tmp_path / "w.fmu", fmi=3, whole=True)
    except ValueError as error:
        if "library" in str(error):
            pytest.skip(str(error))
        raise
    with zipfile.ZipFile(tmp_path / "w.fmu") as fmu:
        assert "modelDescription.xml" in fmu.namelist()
    with pytest.raises(OSError):
        world.export_fmu("/proc/w.fmu")
