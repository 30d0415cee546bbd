"""Reactions of teams that share a world, in whole runs: by the trials of the run, on all workers, and again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import sva_bench as sb
from sva_bench.analysis.summaries import Summary
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.reactions import ReactionsJob
from sva_bench.batch.strands import strand
from sva_bench.errors import BadInput
from sva_bench.execution import react
from sva_bench.files.records import as_dict
from sva_bench.storage.stored_run import read_content
from sva_bench.study.options import Options
from sva_bench.study.publish import report_again
from sva_bench.study.replay import Wanted, replay
from tests.worlds_for_tests import SMALL, world_of

# Any leg may be the last of either robot, so that news comes in the middle of missions.
SHARED = SMALL.replace("stop_s: 4}", "stop_s: 4, slots: 2}").replace(
    "{uv2: 0.5}", "{uv1: 0.8, uv2: 0.6}") + "interaction: shared\nfailure: per_leg\n"
QUICK: dict[str, Any] = {"trials": 12, "rollouts": 2, "fidelity": "kinematic", "workers": 1, "scenario": "half",
                         "policy": ["resolve"], "news": ["report", "instant"]}


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> sb.World:
    return world_of(tmp_path_factory.mktemp("world"), SHARED)


@pytest.fixture(scope="module")
def ours(world: sb.World, tmp_path_factory: pytest.TempPathFactory) -> sb.Result[Summary]:
    return sb.run(world, anticipate=True, out=tmp_path_factory.mktemp("runs"), **QUICK)


def folder_of(result: sb.Result[Any]) -> Path:
    assert result.folder is not None
    return result.folder


def outcomes_of(result: sb.Result[Any]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(folder_of(result) / "outcomes.parquet").to_pylist()
    return rows


def test_reacting_is_measured_on_the_trials_of_the_run(ours: sb.Result[Summary]) -> None:
    rows = outcomes_of(ours)

    def mean(planner: str, policy: str, news: str) -> float:
        mine = [row for row in rows if (row["planner"], row["policy"], row["news"]) == (planner, policy, news)]
        assert len({row["trial"] for row in mine}) == 12
        return sum(float(row["value"]) for row in mine) / 12

    (scenario,) = ours.summary.scenarios
    assert scenario.reactions is not None
    for reaction in scenario.reactions:
        assert reaction.histories == "sampled"
        for planner in ("stochastic", "deterministic"):
            with_it, without = mean(planner, "resolve", reaction.news), mean(planner, "none", "never")
            assert reaction.value_of_recourse[planner].mean == pytest.approx(with_it - without)
        for plan in reaction.plans.values():
            assert plan.interaction is not None
            assert (plan.interaction.contacts, plan.interaction.exact_share) == (0.0, 1.0)
            assert plan.reacted > 0


@pytest.mark.long
def test_they_are_the_same_on_any_number_of_workers(world: sb.World, ours: sb.Result[Summary]) -> None:
    two = sb.run(world, anticipate=True, **{**QUICK, "workers": 2})
    assert as_dict(two.summary) == as_dict(ours.summary)


def test_given_plans_react_as_ours_do(world: sb.World, ours: sb.Result[Summary]) -> None:
    plans = {name: plan for name, plan in ours.plans["half"].items() if name in ("stochastic", "deterministic")}
    given = sb.execute(world, plans, **QUICK).summary.scenarios[0].reactions
    our = ours.summary.scenarios[0].reactions
    assert given is not None
    assert our is not None
    for row, other in zip(given, our, strict=True):
        assert row.news == other.news
        for name in plans:
            assert as_dict(row.plans[name]) == as_dict(other.plans[name])


def test_a_run_is_read_back_and_its_page_is_the_same_again(ours: sb.Result[Summary]) -> None:
    folder = folder_of(ours)
    content = read_content(folder)
    assert content.summary == ours.summary
    assert content.lacking == ()
    assert content.reaction_stems
    page = (folder / "report.html").read_bytes()
    report_again(folder)
    assert (folder / "report.html").read_bytes() == page


def test_every_trial_replayed_gives_its_rows_to_the_bit(ours: sb.Result[Summary]) -> None:
    rows = outcomes_of(ours)
    lost = {row["trial"] for row in rows if row["end"] == "failed" and row["policy"] == "resolve"}
    assert lost
    for news in ("report", "instant"):
        for trial in sorted({0, 11, *list(lost)[:2]}):
            for found in replay(folder_of(ours), Wanted(scenario=None, trial=trial, policy="resolve", news=news), None,
                                lambda *_: None):
                assert list(found.rows) == [row for row in rows if (
                    row["planner"], row["policy"], row["news"], row["trial"]) == (
                        found.case.planner, "resolve", news, trial)]
                assert found.recording
                assert found.recording.is_file()
                assert found.told()


def test_a_batch_measures_them_as_a_run_does(world: sb.World, ours: sb.Result[Summary]) -> None:
    options = Options(trials=12, rollouts=2, fidelity="kinematic", policies=("resolve",), news=("report", "instant"),
                      anticipate=True)
    point = Point(world=world, planner="prmstar")
    steps = strand(Grid(points=[point], seeds=[0], options=options, unit_trials=100), point, 0, frozenset())
    jobs = next(steps)
    while not isinstance(jobs[0], ReactionsJob):
        jobs = steps.send([job.run() for job in jobs])
    result = jobs[0].run()
    assert jobs[0].fits(result)
    our = ours.summary.scenarios[0].reactions
    assert our is not None
    for one, other in zip(result["half"], our, strict=True):
        assert json.dumps(as_dict(one)) == json.dumps(as_dict(other))


def test_robots_that_nobody_coordinates_react_too(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED.replace("shared", "uncoordinated"))
    done = sb.run(world, out=tmp_path / "runs", **QUICK)
    (scenario,) = done.summary.scenarios
    assert scenario.reactions is not None
    assert all(plan.reacted > 0 for reaction in scenario.reactions for plan in reaction.plans.values())
    assert read_content(folder_of(done)).summary == done.summary


def test_more_trials_than_memory_holds_are_refused_before_anything_is_driven(
        world: sb.World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(react, "MOST_TRIALS_HELD", 100)
    with pytest.raises(BadInput, match="not gone through, for its robots meet, and at most 8 trials can be sampled"):
        sb.run(world, **QUICK)
