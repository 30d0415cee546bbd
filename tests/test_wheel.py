"""The wheel: built without a trace in the tree, whole, and at work in another folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "sva_bench", "worlds", "plans")

pytestmark = pytest.mark.skipif(
    not (find_spec("pip") and find_spec("hatchling")),
    reason="pip and hatchling, which build wheels, are missing; `make setup` installs them")


def listed(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def pip(*arguments: str | Path) -> None:
    """Without a network: what is needed is here already."""
    subprocess.run([sys.executable, "-m", "pip", *map(str, arguments), "--quiet", "--no-index", "--no-deps",
                    "--disable-pip-version-check"], check=True, timeout=300)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of a copy of the tree, in which nothing else is at work."""
    place = tmp_path_factory.mktemp("wheel")
    tree = place / "tree"
    tree.mkdir()
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, tree)
    before = listed(tree)
    pip("wheel", tree, "--no-build-isolation", "--wheel-dir", place / "out")
    assert listed(tree) == before, "building leaves something behind"
    (built,) = (place / "out").iterdir()
    return built


def test_a_wheel_holds_all_of_the_package_with_its_worlds_and_plans_and_nothing_else(wheel: Path) -> None:
    expected = {path.relative_to(ROOT).as_posix() for path in (ROOT / "sva_bench").rglob("*")
                if path.is_file() and "__pycache__" not in path.parts}
    expected |= {f"sva_bench/shipped/{path.relative_to(ROOT).as_posix()}" for folder in ("worlds", "plans")
                 for path in (ROOT / folder).iterdir()}
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == expected


@pytest.fixture(scope="module")
def bench(wheel: Path) -> Path:
    """The command in an environment of its own, into which the wheel is installed; libraries are those at hand."""
    place = wheel.parents[1] / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", place], check=True, timeout=120)
    pip("--python", place / "bin" / "python", "install", wheel)
    (packages,) = place.glob("lib/python*/site-packages")
    (packages / "libraries.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    return place / "bin" / "sva-bench"


def typed(bench: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command typed in a folder that has nothing to do with the tree."""
    foreign = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([bench, *arguments], cwd=folder, env=foreign, text=True, capture_output=True, timeout=900,
                          check=False)


def test_an_installed_wheel_has_the_shipped_worlds_at_hand(bench: Path, tmp_path: Path) -> None:
    there = typed(bench, tmp_path, "world", "example", "--list")
    assert there.returncode == 0, there.stderr
    plans = [Path(line) for line in there.stdout.split() if line.endswith(".json")]
    assert {path.name for path in plans} == {path.name for path in (ROOT / "plans").iterdir()}
    assert all(path.is_file() and bench.parents[1] in path.parents for path in plans)


def test_an_installed_wheel_refuses_the_table_of_runtimes_without_a_checkout(bench: Path, tmp_path: Path) -> None:
    refused = typed(bench, tmp_path, "reproduce", "runtimes")
    assert refused.returncode == 2
    assert "use a checkout" in refused.stderr


@pytest.mark.long  # a minute of compiling: nothing of the environment is compiled yet
def test_an_installed_wheel_runs_a_shipped_world_in_another_folder(bench: Path, tmp_path: Path) -> None:
    copied = typed(bench, tmp_path, "world", "example", "four-rooms", "-o", "mine.yaml")
    assert copied.returncode == 0, copied.stderr
    ran = typed(bench, tmp_path, "run", "mine.yaml", "--scenario", "S3", "--fidelity", "kinematic", "--trials", "20",
                "--rollouts", "2", "--out", "out")
    assert ran.returncode == 0, ran.stderr
    assert "stochastic" in ran.stdout
    assert len(list(tmp_path.glob("out/four-rooms-seed0-*/outcomes.parquet"))) == 1
