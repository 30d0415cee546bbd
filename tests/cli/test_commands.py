"""The commands as a user types them: files, exit codes, and what stands on which output."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.cli.terminal import set_up_logging
from sva_bench.study import costs
from tests.commands_for_tests import sva_bench, sva_bench_alone
from tests.worlds_for_tests import SMALL

QUIET = SMALL.replace("wheel_gain_sd: 0.01", "wheel_gain_sd: 0.0")


def world_file(folder: Path, text: str = SMALL) -> Path:
    path = folder / "small.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder and the printed summary of one run in physics."""
    folder = tmp_path_factory.mktemp("run")
    done = sva_bench_alone("run", world_file(folder), "--trials", 40, "--rollouts", 2, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    (run,) = (folder / "runs").iterdir()
    return run, json.loads(done.stdout)


def test_a_run_leaves_every_file_of_the_contract(finished: tuple[Path, dict[str, Any]]) -> None:
    run, _ = finished
    assert run.name.startswith("small-seed0-")
    stems = [f"{scenario}-{planner}" for scenario in ("half", "safe") for planner in ("stochastic", "deterministic")]
    found = {str(path.relative_to(run)) for path in run.rglob("*") if path.is_file()}
    assert found == {
        "manifest.json", "travel_times.parquet", "legs.parquet", "instance-half.json", "instance-safe.json",
        "outcomes.parquet", "summary.json", "report.html", "paths.parquet", "recordings/half+compare.rrd",
        *(f"plans/{stem}.json" for stem in stems), *(f"recordings/{stem}.rrd" for stem in stems)}
    checked = subprocess.run([str(Path(sys.executable).with_name("rerun")), "rrd", "verify",
                              *map(str, (run / "recordings").iterdir())], capture_output=True, check=False)
    assert checked.returncode == 0, checked.stderr


def test_json_on_standard_output_is_the_summary_file(finished: tuple[Path, dict[str, Any]]) -> None:
    run, printed = finished
    assert json.loads((run / "summary.json").read_text()) == printed


def test_the_summary_adds_up(finished: tuple[Path, dict[str, Any]]) -> None:
    _, summary = finished
    assert summary["reproducible"]
    for scenario in summary["scenarios"]:
        for plan in scenario["plans"].values():
            ledger = dict(plan["ledger"])
            executed = ledger.pop("executed")
            assert executed == plan["executed"]["mean"]
            assert sum(ledger.values()) == pytest.approx(executed, abs=1e-9)
            assert sum(plan["by_robot"].values()) == pytest.approx(executed, abs=1e-9)
            assert sum(plan["ends"].values()) == 2 * summary["trials"]
            assert plan["bound"] - plan["promised"] <= 1e-6 * max(1, plan["promised"])
        vss, plans = scenario["vss"], scenario["plans"]
        assert vss["modelled"] == pytest.approx(plans["stochastic"]["expected"] - plans["deterministic"]["expected"])
        assert vss["executed"]["mean"] == pytest.approx(
            plans["stochastic"]["executed"]["mean"] - plans["deterministic"]["executed"]["mean"])
        assert vss["modelled"] >= 0  # EEV <= RP
        assert scenario["evpi"] >= 0  # RP <= WS
        assert vss["modelled_range"][0] == pytest.approx(vss["modelled"])
        assert vss["modelled_range"][1] >= vss["modelled_range"][0]
    (safe,) = [s for s in summary["scenarios"] if s["name"] == "safe"]
    assert safe["vss"]["executed"]["mean"] == 0  # nothing fails: both plans are one
    assert not safe["vss"]["distinguishable"]


def test_outcomes_hold_a_row_per_plan_trial_and_robot(finished: tuple[Path, dict[str, Any]]) -> None:
    run, summary = finished
    table = pq.read_table(run / "outcomes.parquet")
    assert table.num_rows == 2 * 2 * 40 * 2
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    assert set(columns) >= {
        "scenario", "planner", "trial", "rollout", "robot", "available", "incentive", "pois_reached", "stops_reached",
        "end", "end_time_s", "fuel_used_s", "fidelity"}
    rows = list(zip(*(columns[k] for k in ("scenario", "planner", "incentive")), strict=True))
    for scenario in summary["scenarios"]:
        for planner, plan in scenario["plans"].items():
            total = sum(e for s, p, e in rows if (s, p) == (scenario["name"], planner))
            assert total / 40 == pytest.approx(plan["executed"]["mean"])
    failures: dict[tuple[int, str], set[bool]] = {}
    for scenario, trial, robot, available in zip(
            columns["scenario"], columns["trial"], columns["robot"], columns["available"], strict=True):
        if scenario == "half":
            failures.setdefault((trial, robot), set()).add(available)
    assert all(len(seen) == 1 for seen in failures.values())  # both plans meet the same failures


def test_legs_are_driven_in_the_time_that_was_planned(finished: tuple[Path, dict[str, Any]]) -> None:
    run, _ = finished
    legs = pq.read_table(run / "legs.parquet").to_pylist()
    assert legs
    for leg in legs:
        # Wheel gains of sd 1 % move a leg by less than 4 % (4 sd), physics against the twin by less than 1 %.
        assert leg["driven_s"] == pytest.approx(leg["planned_s"], rel=0.05)


def test_the_same_command_gives_the_same_rows_on_any_number_of_workers(
    finished: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    run, _ = finished
    done = sva_bench("run", world_file(tmp_path), "--trials", 40, "--rollouts", 2, "--workers", 1, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (again,) = (tmp_path / "runs").iterdir()
    assert again.name == run.name
    assert (again / "summary.json").read_bytes() == (run / "summary.json").read_bytes()
    for table in ("outcomes.parquet", "legs.parquet", "travel_times.parquet"):
        assert pq.read_table(again / table).equals(pq.read_table(run / table))


@pytest.mark.long
def test_another_seed_gives_other_failures_and_the_same_plans(
    finished: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    run, _ = finished
    done = sva_bench("run", world_file(tmp_path), "--trials", 40, "--seed", 1, "--fidelity", "kinematic",
                     cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (other,) = (tmp_path / "runs").iterdir()
    assert other.name.startswith("small-seed1-")
    for plan in (run / "plans").iterdir():
        routes = [json.loads((folder / "plans" / plan.name).read_text())["routes"] for folder in (run, other)]
        assert routes[0] == routes[1]
    failures = [pq.read_table(folder / "outcomes.parquet").column("available").to_pylist() for folder in (run, other)]
    assert failures[0] != failures[1]


@pytest.mark.long
def test_without_noise_the_closed_form_is_met_and_nobody_fails_but_by_draw(tmp_path: Path) -> None:
    done = sva_bench("run", world_file(tmp_path, QUIET), "--trials", 400, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["rollouts"] == 1
    for scenario in summary["scenarios"]:
        for plan in scenario["plans"].values():
            assert set(plan["ends"]) <= {"home", "failed"}
            low, high = plan["executed"]["ci95"]
            # The seed is fixed, so this either always holds or never; 1e-9 is for intervals of no width.
            assert low - 1e-9 <= plan["expected"] <= high + 1e-9


def test_times_plan_and_certify_work_hand_in_hand(tmp_path: Path) -> None:
    world = world_file(tmp_path)
    assert sva_bench("times", world, "-o", "i.json", "--scenario", "half", cwd=tmp_path).returncode == 0
    instance = json.loads((tmp_path / "i.json").read_text())
    assert instance["vehicles"][1]["availability"] == 0.5
    done = sva_bench("plan", "i.json", "-o", "p.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    plan = json.loads((tmp_path / "p.json").read_text())
    assert plan["status"] == "optimal"
    checked = sva_bench("certify", "i.json", "p.json", "--json", cwd=tmp_path)
    assert checked.returncode == 0
    certificate = json.loads(checked.stdout)
    assert certificate["feasible"]
    assert certificate["reasons"] == []
    assert certificate["expected"] == pytest.approx(plan["value"])
    direct = sva_bench("plan", world, "--scenario", "half", cwd=tmp_path)
    assert json.loads(direct.stdout)["routes"] == plan["routes"]
    lasting = json.loads(sva_bench("plan", world, "--scenario", "half", "--plan-failure", "hazard",
                                   cwd=tmp_path).stdout)
    assert lasting["value"] > plan["value"]  # a robot that fails late brings what it collected before
    refused = sva_bench("plan", "i.json", "--plan-failure", "per_leg", cwd=tmp_path)
    assert "--plan-failure belongs to a world" in refused.stderr
    greedy = json.loads(sva_bench("plan", "i.json", "--objective", "deterministic", cwd=tmp_path).stdout)
    assert greedy["objective"] == "deterministic"
    assert greedy["value"] >= plan["value"]


TINY = """{"format": "sva-bench/instance@1", "name": "tiny", "sites": ["base", "p1"], "base": "base", "stations": [],
 "fuel_s": [[0, 6], [5, 0]], "failure": "mission", "vehicles": [{"name": "uv1", "fuel_capacity_s": 10,
 "mission_limit_s": 30, "availability": 1.0, "incentives": {"p1": 10}}]}"""


def test_an_infeasible_plan_is_refused_with_three(tmp_path: Path) -> None:
    (tmp_path / "i.json").write_text(TINY)
    (tmp_path / "p.json").write_text(json.dumps(
        {"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"]}}))
    done = sva_bench("certify", "i.json", "p.json", "--json", cwd=tmp_path)
    assert done.returncode == 3
    certificate = json.loads(done.stdout)
    assert not certificate["feasible"]
    assert "11.000 s" in certificate["reasons"][0]  # 6 + 5 on a filling of 10


@pytest.mark.parametrize(("change", "said"), [
    (("margin", "magrin"), "magrin"),
    (("wheel_gain_sd: 0.01", "wheel_gain_sd: -1"), "noise.wheel_gain_sd"),
    (("p1: {at_m: [2.2, 0.8]}", "p1: {at_m: [2.2, 4.0]}"), "inside an obstacle"),
    (("availability: 0.75", "availability: 1.75"), "robots.uv2.availability"),
    (("{uv2: 0.5}", "{uv3: 0.5}"), "did you mean"),
])
def test_bad_worlds_give_one_clear_error_and_leave_nothing(
    change: tuple[str, str], said: str, tmp_path: Path
) -> None:
    text = SMALL + "margin: 0.01\n"
    assert change[0] in text
    done = sva_bench("run", world_file(tmp_path, text.replace(*change)), cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "small.yaml:" in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("arguments", [
    ("run", "missing.yaml"), ("run", "small.yaml", "--scenario", "S9"), ("run", "small.yaml", "--trials", "0"),
    ("run", "small.yaml", "--trails", "5"), ("run", "small.yaml", "--gap", "inf"),
    ("run", "small.yaml", "--margin", "nan"), ("plan", "small.yaml", "--method", "magic"), ("certify", "small.yaml"),
    ("view", "nothing.rrd"), ("times", "small.yaml", "-o", "no/such/folder/i.json"),
    ("plan", "small.yaml", "-o", "./small.yaml"), ("times", "small.yaml", "-o", "small.yaml"),
    ("world", "draw", "small.yaml", "-o", "no/such/folder/p.png"), ("plan", "small.yaml", "--beta", "0.5"),
    ("plan", "small.yaml", "--weight", "0.5"), ("plan", "small.yaml", "--cuts", "multi"), ("fly",)])
def test_bad_usage_exits_with_two(arguments: tuple[str, ...], tmp_path: Path) -> None:
    world_file(tmp_path)
    done = sva_bench(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["small.yaml"]
    assert (tmp_path / "small.yaml").read_text(encoding="utf-8") == SMALL


def test_an_output_that_is_a_link_or_a_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY)
    (tmp_path / "target.json").write_text("old")
    (tmp_path / "link.json").symlink_to("target.json")
    assert sva_bench("plan", "tiny.json", "-o", "link.json", cwd=tmp_path).returncode == 0
    assert (tmp_path / "link.json").is_symlink()
    assert json.loads((tmp_path / "target.json").read_text())["status"] == "optimal"
    os.mkfifo(tmp_path / "pipe")
    with subprocess.Popen(["cat", "pipe"], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as reader:
        assert sva_bench("plan", "tiny.json", "-o", "pipe", cwd=tmp_path).returncode == 0
        assert json.loads(reader.communicate()[0])["status"] == "optimal"
    assert (tmp_path / "pipe").is_fifo()


def test_a_plan_for_something_else_is_told_apart(tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY.replace('"fuel_capacity_s": 10', '"fuel_capacity_s": 11'))
    (tmp_path / "plan.json").write_text(
        '{"format": "sva-bench/plan@1", "instance": "another", "routes": {"uv1": ["base", "p1", "base"]}}')
    done = sva_bench("certify", "tiny.json", "plan.json", cwd=tmp_path)
    assert done.returncode == 0
    assert "was made for another, not for tiny" in " ".join(done.stderr.split())


def test_an_empty_recording_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "empty.rrd").touch()
    done = sva_bench("view", "empty.rrd", "--screenshot", "s.png", cwd=tmp_path)
    assert done.returncode == 2
    assert "cut off or damaged" in " ".join(done.stderr.split())


def test_help_says_what_each_command_does(tmp_path: Path) -> None:
    overview = sva_bench("--help", cwd=tmp_path)
    assert overview.returncode == 0
    for command in ("run", "times", "plan", "certify", "view"):
        assert command in overview.stdout
        page = sva_bench(command, "--help", cwd=tmp_path)
        assert page.returncode == 0
        assert "Usage" in page.stdout


@pytest.mark.spread(1)
@pytest.mark.parametrize("after_s", [2.5, 5.0])
def test_ctrl_c_ends_a_run_with_130_and_leaves_nothing_half_written(after_s: float, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "sva_bench", "run", str(world_file(tmp_path)), "--rollouts", "500", "--trials", "500"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    time.sleep(after_s)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert "interrupted" in said
    assert not list(tmp_path.glob("runs/*"))


@pytest.mark.parametrize(("arguments", "says"), [
    (("run", "w.yaml", "--planner", "rrtstar"), "'--planner': 'rrtstar' is not one of 'prmstar'"),
    (("world", "random", "--pois", "0"), "'--pois': expected at least 4, found 0"),
    (("world", "random", "--pois", "many"), "'--pois': expected an integer, found many"),
    (("world", "random", "--density", "2"), "'--density': expected at most 1.0, found 2"),
    (("world", "random", "--density", "0,5"),
     "'--density': expected a number, found '0,5': write a decimal point, 0.5"),
])
def test_what_is_wrong_with_an_option_is_said_with_its_value(
    arguments: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str],
) -> None:
    assert run_command_line(arguments) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("command", ["execute w.yaml {}", "world draw w.yaml -o w.png --plan {}"])
@pytest.mark.parametrize(("routes", "code", "says"), [
    (None, 2, "p.json: no such file"), ("{", 2, "p.json:1: not valid JSON"),
    ('{"format": "sva-bench/plan@1", "routes": {"uv9": []}}', 2, "there is no vehicle 'uv9'"),
    ('{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", 5]}}', 2,
     'found the number 5; if it is a name, write "5"'),
    ('{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "p1", "base"]}}', 3,
     "uv1: POI 'p1' is visited twice; name it once"),
    ('{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1"]}}', 3, "must start and end at the base"),
])
def test_a_plan_that_cannot_be_driven_is_refused_before_anything_is_planned(
    command: str, routes: str | None, code: int, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    world_file(tmp_path).rename("w.yaml")
    if routes is not None:
        Path("p.json").write_text(routes)

    def planned(*_: object, **__: object) -> None:
        raise AssertionError("travel times are planned")

    monkeypatch.setattr(costs, "plan_travel_times", planned)
    assert run_command_line(command.format("p.json").split()) == code
    said = capsys.readouterr().err
    assert says in said
    assert said.startswith("error: p.json:")


@pytest.mark.parametrize("again", ["p.json", "./p.json", "link.json", "../{}/p.json"])
def test_a_plan_that_is_given_twice_is_refused_as_that(
    again: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    world_file(tmp_path).rename("w.yaml")
    Path("p.json").write_text('{"format": "sva-bench/plan@1", "routes": {}}')
    Path("sub").mkdir()
    Path("sub/p.json").write_text('{"format": "sva-bench/plan@1", "routes": {}}')
    again = again.format(tmp_path.name)
    if again == "link.json":
        again = "linked/p.json"
        Path("linked").symlink_to(tmp_path)
    assert run_command_line(["execute", "w.yaml", "p.json", again]) == 2
    assert capsys.readouterr().err == f"error: {Path(again)}: this plan is given twice; name it once\n"
    assert run_command_line(["execute", "w.yaml", "p.json", "sub/p.json"]) == 2
    assert "there is another plan named 'p'" in capsys.readouterr().err


def test_warnings_are_one_line_each_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    set_up_logging(verbose=False)
    logging.getLogger("sva_bench.test").warning("a %s warning", "long " * 40)
    assert capsys.readouterr().err == f"WARNING a {'long ' * 40} warning\n"
