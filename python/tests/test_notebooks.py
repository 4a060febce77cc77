"""The notebooks run, and their own assertions hold."""

import json
import os
import pathlib
from typing import Any

import pytest

FOLDER = pathlib.Path(__file__).parents[2] / "docs" / "notebooks"


@pytest.mark.parametrize(
    ("name", "needs"), [("notes", []), ("walls", []), ("control", ["control"]), ("mujoco", ["mujoco"])]
)
def test_a_notebook_runs(name: str, needs: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    for module in needs:
        pytest.importorskip(module)
    matplotlib.use("Agg")
    monkeypatch.chdir(FOLDER)
    scope: dict[str, Any] = {"__name__": "__main__"}
    for number, cell in enumerate(json.loads((FOLDER / f"{name}.ipynb").read_text())["cells"]):
        assert not cell.get("outputs"), "notebooks are kept without outputs"
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{name}.ipynb, cell {number}", "exec"), scope)
    import matplotlib.pyplot as plt

    assert plt.get_fignums()
    plt.close("all")


def test_every_notebook_is_run() -> None:
    assert sorted(os.listdir(FOLDER)) == ["control.ipynb", "mujoco.ipynb", "notes.ipynb", "walls.ipynb"]
