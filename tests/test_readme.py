"""What README and docs say can be typed can: their commands are run, and their Python."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from sva_bench.recording.viewer import LAVAPIPE
from tests.reference import reference

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
BIN = Path(sys.executable).parent

SHORT = "--trials 20 --rollouts 1 --fidelity kinematic"
"""Put behind commands that would take minutes: of an option that stands twice the later counts."""
NOT_RUN = {
    "make ": "sets up an environment, or is this very suite",
    ". .venv": "the environment is that of the tests",
    "docker ": "there is no engine here",
}
LONG = ("sva-bench batch", "sva-bench view")
"""These take long: batches of all worlds, and a viewer."""


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of a language in a page."""
    found: list[str] = re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"),
                                  re.MULTILINE | re.DOTALL)
    return found


def commands_of(page: Path) -> list[str]:
    """What is typed in the console blocks of a page, without comments; ``here$`` and the like are other machines."""
    lines = [line for block in blocks(page, "console") for line in block.replace("\\\n", " ").splitlines()]
    return [re.sub(r"\s+#\s.*", "", line.removeprefix("$ ")).strip() for line in lines if line.startswith("$ ")]


COMMANDS = [command for page in PAGES for command in commands_of(page)]
OURS = [command for command in COMMANDS if command.startswith("sva-bench ")]


def as_run(command: str) -> str | None:
    """The command as the test runs it; ``None`` where it would open a window, or wants a driver."""
    words = command.split()
    if words[1] == "view" and ("--screenshot" not in words or not LAVAPIPE.exists()):
        return None
    takes_trials = words[1] in ("run", "execute") or (words[1] == "batch" and words[2] not in ("status", "retry"))
    return f"{command} {SHORT}" if takes_trials else command


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with what the pages name: the shipped worlds and plans, and the world and sweep in their blocks."""
    for name in ("worlds", "plans", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name)
    for page in PAGES:
        for block in blocks(page, "yaml"):
            if block.startswith("format: sva-bench/world@1"):
                (title,) = re.findall(r"^name: (\S+)$", block, re.MULTILINE)
                (tmp_path / f"{title}.yaml").write_text(block, encoding="utf-8")
            elif block.startswith("format: sva-bench/sweep@1"):
                (tmp_path / "sweep.yaml").write_text(block, encoding="utf-8")
    return tmp_path


def run_all(commands: list[str], folder: Path) -> None:
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "XDG_CACHE_HOME": str(folder / "c")}
    for command in commands:
        if (told := as_run(command)) is not None:
            done = subprocess.run(told, shell=True, cwd=folder, env=environment, text=True, capture_output=True,
                                  timeout=900, check=False)
            assert done.returncode == 0, f"{told}\n{done.stdout}{done.stderr}"


def test_every_command_in_a_console_block_is_run_or_has_a_reason_not_to_be() -> None:
    assert len(OURS) >= 8
    for command in COMMANDS:
        assert command.startswith(("sva-bench ", *NOT_RUN)), f"say in NOT_RUN why this is not run: {command}"


def test_targets_of_make_that_are_named_are_there() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    targets = set(re.findall(r"(?:^\$ |`)make ([a-z-]+)", named, re.MULTILINE))
    assert {"run", "test", "lint"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_commands_in_console_blocks_run(folder: Path) -> None:
    run_all([command for command in OURS if not command.startswith(LONG)], folder)


@pytest.mark.long
def test_all_commands_in_console_blocks_run_batches_and_viewer_too(folder: Path) -> None:
    run_all(OURS, folder)


@pytest.mark.parametrize("command", [
    "sva-bench run two-rooms.yaml", "sva-bench world draw two-rooms.yaml -o two-rooms.svg",
    "sva-bench world random -o random.yaml",
])
def test_commands_on_the_world_of_the_page_run(command: str, folder: Path) -> None:
    assert f"`{command}`" in re.sub(r"\s+", " ", PAGES[0].read_text(encoding="utf-8"))
    run_all([command], folder)


def test_every_command_in_the_text_of_a_page_is_one() -> None:
    from sva_bench.cli.app import app

    known = {info.name or getattr(info.callback, "__name__", "") for info in app.registered_commands}
    known |= {info.name for info in app.registered_groups if info.name}
    for page in PAGES:
        for command in re.findall(r"`sva-bench ([a-z]+)", page.read_text(encoding="utf-8")):
            assert command in known, f"{page.name}: sva-bench {command}"


PYTHON = [(page.name, block) for page in PAGES for block in blocks(page, "python")
          if not block.startswith("sb.")  # signatures of the reference
          and page.name not in ("extending.md", "recordings.md")]  # whose blocks tests of their own run
EXAMPLE = (ROOT / "examples" / "from_world_to_vss.py").read_text(encoding="utf-8")


def test_the_example_runs_as_it_is(folder: Path) -> None:
    done = subprocess.run([sys.executable, ROOT / "examples" / "from_world_to_vss.py"], cwd=folder, text=True,
                          capture_output=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert "VSS modelled 127.5, executed 1" in done.stdout
    assert (folder / "four-rooms-S3.rrd").exists()
    assert EXAMPLE.count("\n") <= 25


def test_the_example_stands_in_the_pages_as_it_is() -> None:
    assert [name for name, block in PYTHON if block == EXAMPLE] == ["README.md", "api.md"]


@pytest.mark.parametrize(("name", "block"), [entry for entry in PYTHON if entry[1] != EXAMPLE])
def test_other_python_of_a_page_is_python_and_needs_what_we_do_not_install(name: str, block: str) -> None:
    compile(block, name, "exec")
    assert re.search(r"\b(pandas|pd)\.", block), "run this block too"
    assert find_spec("pandas") is None, "pandas is here: run these blocks on a run folder"


def test_the_reference_is_that_of_the_docstrings() -> None:
    assert (ROOT / "docs" / "api.md").read_text(encoding="utf-8") == reference(), \
        "python -m tests.reference > docs/api.md"
