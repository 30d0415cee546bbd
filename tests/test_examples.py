"""The notebook and the scripts of ``examples/``, run as they are."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from traitlets.config import Config

EXAMPLES = Path(__file__).parents[1] / "examples"
SAID = {
    "from_world_to_vss.py": ("VSS modelled 127.5, executed 1",),
    "own_plan.py": ("by hand: feasible, expected value 70.0", "not distinguishable from zero"),
    "availability.py": ("     50 %        70.0           60.0  10.0\n", "    100 %       120.0          120.0   0.0\n"),
}
"""What each script says, among other things; the first two of examples/two-rooms.yaml are worked out by hand in
docs/two-rooms.md."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with what scripts name by their place in a checkout."""
    for name in ("worlds", "examples"):
        shutil.copytree(EXAMPLES.parent / name, tmp_path / name)
    return tmp_path


def test_every_script_is_run() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SAID)


@pytest.mark.long
@pytest.mark.parametrize("script", sorted(SAID))
def test_a_script_runs_and_says_what_it_should(script: str, folder: Path) -> None:
    done = subprocess.run([sys.executable, f"examples/{script}"], cwd=folder, text=True, capture_output=True,
                          timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    for words in SAID[script]:
        assert words in done.stdout
    assert (EXAMPLES / script).read_text(encoding="utf-8").count("\n") <= 30


def said(notebook: nbformat.NotebookNode) -> list[str]:
    """What the cells of a notebook printed."""
    return ["".join(output["text"] for output in cell.outputs if output.output_type == "stream")
            for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.long
def test_the_notebook_runs_and_prints_what_is_stored_in_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder / "examples" / "mission_value.ipynb"
    stored, run = (nbformat.read(path, as_version=4) for _ in range(2))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(folder))
    # By sockets in a folder of ours, not over TCP; nobody's own settings of IPython are loaded.
    monkeypatch.setenv("IPYTHONDIR", str(folder / "ipython"))
    monkeypatch.chdir(folder)
    NotebookClient(run, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}},
                   config=Config(KernelManager={"transport": "ipc", "ip": os.path.join(folder, "kernel")})).execute()
    assert said(run) == said(stored)
    assert sum(bool(words) for words in said(stored)) >= 5
