"""Missions in which physics fails: PyBullet, given a robot of a mass beyond all bounds, gives NaN for its pose.

No world file brings that about (of 5700 random robots and loads within the bounds none did), but Python may.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.batch.cache import Cache
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.run import run_batch
from sva_bench.choices import ENDS, Fidelity
from sva_bench.errors import ExitCode
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.report.doubts import failed_physics
from sva_bench.study import inputs
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options, settings_of
from sva_bench.study.planning import own_cases, plan_scenarios
from sva_bench.study.run import measure
from sva_bench.study.summing import drives_made
from sva_bench.workers.answers import Caps
from sva_bench.workers.local import LocalProcesses
from sva_bench.world.model import World
from tests.worlds_for_tests import SMALL, world_of

QUICK = Options(trials=4, rollouts=2, fidelity="physics")


def beyond(folder: Path) -> World:
    """The small world, in which the second robot has a mass that no number of physics holds."""
    world = world_of(folder, SMALL)
    first, second = world.robots
    model = replace(second.model, name="beyond", mass_kg=1e300)
    return replace(world, robots=(first, replace(second, model=model)), scenarios=world.scenarios[1:])


def test_a_robot_of_which_physics_gives_no_finite_pose_is_stuck_and_says_why(tmp_path: Path) -> None:
    world = beyond(tmp_path)
    (scenario,) = world.scenarios
    assert scenario.name == "safe"
    costs = plan_costs(world, QUICK.planner, lambda *_: None)
    cases = own_cases(scenario, plan_scenarios(world, costs, QUICK, lambda *_: None)[scenario.name])
    drives = Drives()
    for run in execute(world, costs, cases, replace(settings_of(world, QUICK), recorded=True), drives=drives):
        for robot, found in enumerate(run.end.T.tolist()):
            failed = robot == 1 and bool(run.case.plan.route("uv2"))
            assert {ENDS[end] for end in found} == {"stuck" if failed else "home"}
        (last,) = [event for event in run.traces[1].outcome.events if event.kind == "stuck"]
        assert last.what == "physics failed"
        assert np.isfinite(run.traces[1].pose).all()
    made = drives_made(drives)
    assert (made.physics_failed, made.tipped_over) == (4, 0)  # the routes of uv2 are equal, and driven in each trial


def test_a_run_in_which_physics_failed_says_so_first_and_exits_with_4(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    world = beyond(tmp_path)
    monkeypatch.setattr(inputs, "load", lambda *_, **__: world)
    arguments = ["run", str(tmp_path / "world.yaml"), "--trials", "4", "--rollouts", "2", "--fidelity", "physics",
                 "--workers", "1", "--out", str(tmp_path / "runs")]
    assert run_command_line([*arguments, "--json"]) == ExitCode.UNFINISHED_TRIALS
    told = capsys.readouterr()
    assert json.loads(told.out)["drives"]["physics_failed"] == 4
    assert "Physics failed in 4 of 8 drives" in " ".join(told.err.split())
    assert run_command_line(arguments) == ExitCode.UNFINISHED_TRIALS
    assert "Physics failed in 4 of 8 drives" in " ".join(capsys.readouterr().out.split())
    (page,) = (tmp_path / "runs").glob("*/report.html")
    assert page.read_text(encoding="utf-8").count("Physics failed in 4 of 8 drives") == 1


def test_nothing_is_said_of_physics_that_did_not_fail(tmp_path: Path) -> None:
    summary = measure(world_of(tmp_path), replace(QUICK, fidelity="kinematic"), None, lambda *_: None).summary
    assert summary.drives is not None
    assert failed_physics(summary) == []


@pytest.mark.long
@pytest.mark.parametrize("fidelity", ["rollout", pytest.param("physics", marks=pytest.mark.long)])
def test_a_batch_gives_up_worlds_in_which_physics_fails_at_once_and_goes_on(
        fidelity: Fidelity, tmp_path: Path) -> None:
    good = replace(world_of(tmp_path), name="good")
    grid = Grid(points=[Point(world=world, planner="prmstar") for world in (beyond(tmp_path), good)], seeds=[0],
                options=replace(QUICK, trials=40, rollouts=20, fidelity=fidelity), unit_trials=40)

    class Opened:
        """The engine, closed at the end."""

        def __enter__(self) -> LocalProcesses:
            self.engine = LocalProcesses(1, Caps(time_s=600, memory_mb=0, preload="sva_bench.batch.jobs"))
            return self.engine

        def __exit__(self, *_: object) -> None:
            self.engine.close()

    summary = run_batch(grid, tmp_path / "out", Opened, Cache(folder=tmp_path / "cache"), lambda _: None, resume=False)
    (given_up,) = summary.failed
    assert (given_up.world, given_up.attempts) == ("small", 1)
    assert "physics failed in" in given_up.reason
    assert [unit.world for unit in summary.units] == ["good"]
