"""Cases from the field, typed as their reporters did: small inputs on which the program once did the wrong thing."""

from __future__ import annotations

import json
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sva_bench.mission.certify import certify
from sva_bench.mission.instance_file import read_instance
from sva_bench.mission.plan_file import read_plan
from sva_bench.solver.risk import RiskMeasure
from tests.commands_for_tests import sva_bench
from tests.solver.oracle import risk_optimum

CASES = Path(__file__).parents[1] / "../shared/cases"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not part of the repository")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of our own with the inputs in it."""
    for file in CASES.iterdir():
        shutil.copyfile(file, tmp_path / file.name)
    return tmp_path


@pytest.mark.parametrize("options", [["--pois", 40, "--vehicles", 4, "--seed", 3],
                                     ["--pois", 60, "--vehicles", 2, "--directed"]])
def test_ctrl_c_keeps_the_best_plan(folder: Path, options: list[object]) -> None:
    assert sva_bench("instance", "random", "-o", "i.json", *options, cwd=folder).returncode == 0
    solve = subprocess.Popen([sys.executable, "-m", "sva_bench", "plan", "i.json", "-o", "p.json"], cwd=folder,
                             stderr=subprocess.PIPE, text=True, start_new_session=True)
    time.sleep(6)
    solve.send_signal(signal.SIGINT)
    _, said = solve.communicate(timeout=60)
    if solve.returncode == 0:
        pytest.skip("this machine proved the plan before it could be interrupted")
    assert solve.returncode == 130
    assert "interrupted: value" in said
    plan = read_plan(folder / "p.json", read_instance(folder / "i.json"))
    assert plan.status == "interrupted"
    assert certify(read_instance(folder / "i.json"), plan).feasible


def test_small_incentives_are_planned_like_large_ones(folder: Path) -> None:
    said, plans = [], []
    for size in ("small", "large"):
        done = sva_bench("plan", f"incentives-{size}.json", "--gap", 0.1, "-o", f"{size}-plan.json", cwd=folder)
        assert done.returncode == 0
        said.append(done.stderr.strip().splitlines()[-1])
        plans.append(json.loads((folder / f"{size}-plan.json").read_text()))
    small, large = plans
    assert small["routes"] == large["routes"]
    assert small["status"] == large["status"] == "optimal"
    assert small["value"] == pytest.approx(large["value"] / 1e5, rel=1e-9)
    assert (small["bound"] - small["value"]) / small["value"] <= 0.1
    shown = [words.split("relative gap ")[1].split(",")[0] for words in said]
    assert shown[0] == shown[1]


def test_a_hatched_map_is_checked_in_seconds(folder: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = sva_bench("world", "check", "hatch-world.yaml", cwd=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stderr
    # 5 s on an idle machine; compiling for the first time, and busy cores, may take as much again twice.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 20


def test_a_map_without_a_free_cell_is_an_error(folder: Path) -> None:
    done = sva_bench("world", "from-map", "transparent.yaml", "--pois", 4, "--stations", 1, "-o", "w.yaml", cwd=folder)
    assert done.returncode == 2
    for word in ("free", "unknown", "--unknown free", "negate", "mode"):
        assert word in done.stderr
    assert not (folder / "w.yaml").exists()


def test_an_unknown_key_of_a_map_gives_one_warning_with_the_users_file(folder: Path) -> None:
    done = sva_bench("world", "from-map", "typed.yaml", "--pois", 4, "--stations", 1, "-o", "w.yaml", cwd=folder)
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stderr.splitlines() if "type" in line]
    assert len(told) == 1
    assert "typed.yaml" in told[0]
    assert "/tmp" not in done.stderr.replace(str(folder), "")


def test_a_yaw_of_ninety_radians_gives_a_warning(folder: Path) -> None:
    done = sva_bench("world", "from-map", "degrees.yaml", "--pois", 4, "--stations", 1, "-o", "w.yaml", cwd=folder)
    assert "degrees" in done.stderr
    assert "radians" in done.stderr


def test_a_mission_without_reachable_pois_is_reported(folder: Path) -> None:
    done = sva_bench("run", "out-of-reach.yaml", "--trials", 50, "--rollouts", 2, "--fidelity", "kinematic", "--out",
                     "runs", cwd=folder)
    told = " ".join((done.stdout + done.stderr).split())
    assert "fuel" in told
    assert "reach" in told
    assert "changes nothing here: both plans are the same" not in told
    (page,) = (folder / "runs").glob("*/report.html")
    assert "reach" in page.read_text()


@pytest.mark.parametrize("out", ["f", "/proc/x"])
def test_a_place_that_takes_no_results_is_refused_before_any_work(folder: Path, out: str) -> None:
    (folder / "f").touch()
    done = sva_bench("run", "two-rooms.yaml", "--out", out, cwd=folder)
    assert done.returncode == 2
    assert "--out" in done.stderr
    assert "solving" not in done.stderr


@pytest.mark.parametrize("command", [
    "run two-rooms.yaml --trials 50 --fidelity kinematic --out runs", "world check two-rooms.yaml", "--help"])
def test_a_closed_pipe_is_no_fault(folder: Path, command: str) -> None:
    done = subprocess.run(["bash", "-c", f"{sys.executable} -m sva_bench {command} | true; exit ${{PIPESTATUS[0]}}"],
                          cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "fault" not in done.stderr
    assert ("written to" in done.stderr) == command.startswith("run")


def test_a_wrong_option_is_named(folder: Path) -> None:
    for value, said in (("robots.uv3.availability=0.2", "did you mean 'uv2'?"), ("robots.uv2.availability=1.2", "1.2")):
        done = sva_bench("batch", "two-rooms.yaml", "--set", value, "--dry-run", cwd=folder)
        assert done.returncode == 2
        assert "--set robots" in done.stderr
        assert said in done.stderr
        assert "two-rooms.yaml:" not in done.stderr


@pytest.mark.parametrize("options", [["--risk", "cvar"], ["--risk", "cvar", "--beta", "0.99"],
                                     ["--risk", "excess", "--target", "300"]])
def test_risk_under_joint_failures_ends_with_the_optimum(folder: Path, options: list[str]) -> None:
    done = sva_bench("plan", "cvar-endless.json", *options, "-o", "p.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    plan = json.loads((folder / "p.json").read_text())
    assert plan["status"] == "optimal"
    given = dict(zip(options[::2], options[1::2], strict=True))
    measure = RiskMeasure(kind="cvar" if given["--risk"] == "cvar" else "excess", weight=1.0,
                          beta=float(given.get("--beta", 0.9)), target=float(given.get("--target", 0.0)))
    truth = risk_optimum(read_instance(folder / "cvar-endless.json"), measure)
    assert plan["value"] == pytest.approx(truth, rel=1e-6)


def test_two_names_keep_their_results_apart(folder: Path) -> None:
    done = sva_bench("execute", "two-names.yaml", "b-c.json", "c.json", "--trials", 50, "--fidelity", "kinematic",
                     "--json", "--out", "runs", cwd=folder)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert [s["name"] for s in summary["scenarios"]] == ["a", "a-b"]
    for scenario, collects in zip(summary["scenarios"], (True, False), strict=True):  # nobody is there in a-b
        assert list(scenario["plans"]) == ["b-c", "c"]
        assert all((plan["executed"]["mean"] > 0) == collects for plan in scenario["plans"].values())
    (run,) = (folder / "runs").iterdir()
    assert sorted(path.name for path in (run / "plans").iterdir()) == ["a+b-c.json", "a+c.json", "a-b+b-c.json",
                                                                       "a-b+c.json"]


@pytest.mark.parametrize("sweep", ["sweep-of-variants.yaml", "sweep-of-units.yaml"])
def test_a_sweep_beyond_all_bounds_is_refused_with_its_number(folder: Path, sweep: str) -> None:
    begun = time.monotonic()
    done = sva_bench("batch", sweep, "--dry-run", cwd=folder)
    assert done.returncode == 2
    assert any(word.strip(".,;:()").replace(",", "").isdecimal() for word in done.stderr.split())
    assert time.monotonic() - begun < 60  # seconds on an idle machine
