"""What lies in the current folder is data, imported by no process of ours; and each of them has one thread."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sva_bench.environment import environment_of_children, limit_threads
from tests.worlds_for_tests import SMALL

BESIDE = Path(sys.executable).with_name("sva-bench")

# Before our first line, an interpreter that is started with -m has looked up these itself.
FIRST = {"runpy", "pkgutil", "importlib", "contextlib", "collections", "functools", "types", "warnings", "operator",
         "keyword", "heapq", "reprlib", "enum", "zipimport", "weakref", "copyreg", "typing", "inspect", "ast", "dis",
         "opcode", "token", "tokenize", "linecache", "re", "abc", "io", "os", "stat", "codecs", "encodings", "sys",
         "marshal", "site", "__main__", "__future__", "importlib_metadata", "posixpath", "genericpath", "ntpath"}
LIBRARIES = ["numba", "numpy", "scipy", "typer", "click", "rich", "pydantic", "ruamel", "pyarrow", "ompl", "pybullet",
             "highspy", "networkx", "rerun", "rerun_cli", "matplotlib", "PIL", "sitecustomize", "usercustomize", "yaml",
             "llvmlite", "cycler", "attr", "pandas"]
SPRING = "import os\nopen(os.path.join({folder!r}, 'sprung-{name}'), 'w').close()\nraise SystemExit(77)\n"


@pytest.fixture
def trapped(tmp_path: Path) -> Path:
    """A folder with a world, and a trap for nearly every module that there is."""
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    for name in sorted({*sys.stdlib_module_names, *LIBRARIES} - FIRST - set(sys.builtin_module_names)):
        spring = SPRING.format(folder=str(tmp_path), name=name)
        if name in ("multiprocessing", "concurrent", "logging", "json", "numba", "numpy"):
            (tmp_path / name).mkdir()
            (tmp_path / name / "__init__.py").write_text(spring, encoding="utf-8")
        else:
            (tmp_path / f"{name}.py").write_text(spring, encoding="utf-8")
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: here\n", encoding="utf-8")
    return tmp_path


def sprung(folder: Path) -> list[str]:
    return [path.name for path in folder.glob("sprung-*")]


QUICK = ("--trials", "4", "--rollouts", "2", "--workers", "2")


RUN = ["run", "small.yaml", *QUICK, "--fidelity", "kinematic", "--out", "runs"]
BATCH = ["batch", "small.yaml", *QUICK, "--fidelity", "kinematic", "--out", "out", "--cache", "cache"]
MORE = [["report", "RUN"], ["replay", "RUN", "--trial", "0", "--scenario", "half"],
        ["batch", "status", "out"], ["batch", "retry", "out", "--cache", "cache"],
        ["execute", "small.yaml", "PLAN", *QUICK, "--fidelity", "kinematic", "--out", "runs2"]]


@pytest.mark.long
@pytest.mark.parametrize(("program", "commands"), [
    pytest.param([sys.executable, "-m", "sva_bench"], [RUN, BATCH], id="-m"),
    pytest.param([str(BESIDE)], [RUN, BATCH, *MORE], id="sva-bench")])
def test_no_command_runs_code_of_the_current_folder(
    program: list[str], commands: list[list[str]], trapped: Path
) -> None:
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONSAFEPATH")}
    for command in commands:
        run = next(iter((trapped / "runs").glob("small-*")), Path())
        command = [{"RUN": str(run), "PLAN": str(next(iter((run / "plans").glob("*.json")), ""))}.get(word, word)
                   for word in command]
        done = subprocess.run([*program, *command], cwd=trapped, env=environment, capture_output=True, text=True,
                              timeout=300, check=False)
        assert not sprung(trapped), command
        assert done.returncode == 0, done.stderr
    assert not (trapped / "here").exists()


def test_an_empty_entry_of_pythonpath_is_taken_out_for_us_and_our_children(tmp_path: Path) -> None:
    (tmp_path / "trap.py").write_text("print('sprung')\n", encoding="utf-8")
    script = ("import os, subprocess, sys\nfrom sva_bench.environment import *\nimport multiprocessing\n"
              "distrust_current_folder()\nprint(os.environ['PYTHONPATH'])\n"
              "child = [sys.executable, '-c', 'import trap']\n"
              "print(subprocess.run(child, stderr=subprocess.DEVNULL).returncode)\n"
              "print(subprocess.run(child, stderr=subprocess.DEVNULL, env=environment_of_children()).returncode)\n"
              "import trap\n")
    done = subprocess.run([sys.executable, "-P", "-c", script], cwd=tmp_path, capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": f"{os.pathsep}/nowhere"}, check=False)
    assert done.stdout.split() == ["/nowhere", "1", "1"]
    assert "No module named 'trap'" in done.stderr


def test_a_folder_that_pythonpath_names_stays_where_modules_are_found(tmp_path: Path) -> None:
    (tmp_path / "ours.py").write_text("print('found')\n", encoding="utf-8")
    script = "from sva_bench.environment import *\ndistrust_current_folder()\nimport ours\n"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True,
                          env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}"})
    assert done.stdout == "found\n"


def test_children_find_what_their_parent_finds() -> None:
    assert environment_of_children()["PYTHONPATH"].split(os.pathsep) == [entry for entry in sys.path if entry]


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def test_workers_have_one_thread_each_whatever_the_command_has(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    limit_threads()
    assert [os.environ[name] for name in THREADS] == ["4", "1", "1"]  # who sets one knows why
    assert [environment_of_children()[name] for name in THREADS] == ["1", "1", "1"]
