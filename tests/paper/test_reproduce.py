"""The paper's experiments again, on a small scale."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.choices import NEWS
from sva_bench.errors import BadInput
from sva_bench.execution.case import Settings
from sva_bench.mission.failures import PROCESSES
from sva_bench.paper.reaction import reaction, reaction_page
from sva_bench.paper.rewards import rewards, rewards_page, three_vehicles
from sva_bench.paper.simulation import simulation, simulation_page
from sva_bench.study.costs import nominal_scenario
from sva_bench.world.model import NOMINAL
from tests.worlds_for_tests import SMALL, world_of

SETTINGS = Settings(seed=0, trials=400, rollouts=4, fidelity="kinematic")


def test_the_third_vehicle_is_the_doubtful_one_and_earns_more() -> None:
    team = three_vehicles(10, 0.25, 0).vehicles
    assert [(v.name, v.availability) for v in team] == [("uv1", 1.0), ("uv2", 1.0), ("uv3", 0.25)]
    assert [int((v.incentives > 0).sum()) for v in team] == [5, 5, 10]


def test_rewards_move_to_the_reliable_vehicles_and_the_vss_grows() -> None:
    rows = rewards(sizes=(6,), seeds=(0, 1))
    for seed in (0, 1):
        cases = [row for row in rows if row.seed == seed]
        assert [row.availability for row in cases] == [1.0, 0.75, 0.25, 0.0]
        third = [row.by_vehicle[2] for row in cases]
        assert third == sorted(third, reverse=True)
        assert third[-1] == 0
        assert cases[0].least_pct == 0  # all available: the deterministic plan is right
        for row in cases:
            assert sum(row.by_vehicle) == pytest.approx(row.stochastic)
            assert 0 <= row.least_pct <= row.most_pct
    page = rewards_page(rows)
    assert "10 to 30 % more" in page
    assert "| 6 | 4 | 0 % |" in page


def test_the_simulation_is_executed_as_in_the_paper_and_as_planned(tmp_path: Path) -> None:
    world = world_of(tmp_path, SMALL.replace("limit_s: 120", "limit_s: 30"))
    rows = simulation([world], SETTINGS, None, lambda *_: None)
    assert [(row.world, row.scenario) for row in rows] == [("small", "half"), ("small", "safe")]
    safe = rows[1].under
    assert safe["mission"] == safe["per_leg"]  # nobody fails: both processes are the same
    assert not safe["mission"].vss.excludes_zero
    page = simulation_page(rows, SETTINGS)
    assert "400 trials, 4 noise draws, fidelity kinematic, seed 0" in page
    assert page.count("| small | half |") == 2


@pytest.mark.long
def test_reactions_are_measured_under_every_process_and_kind_of_news(tmp_path: Path) -> None:
    world = world_of(tmp_path, SMALL.replace("limit_s: 120", "limit_s: 30"))
    rows = reaction([world], replace(SETTINGS, rollouts=2), None, lambda *_: None)
    assert [(row.process, row.availability) for row in rows] == [
        (process, share) for process in PROCESSES for share in (0.25, 0.5, 0.75)]
    for row in rows:
        assert list(row.by_news) == list(NEWS)
        never = row.by_news["never"]
        assert all(gain.mean == 0 for gain in never.value_of_recourse.values())
        for result in row.by_news.values():
            assert result.vss_with_recourse.mean >= -1e-9
        if row.process == "mission":  # known at the start, whatever was planned is planned again
            instant = row.by_news["instant"]
            assert instant.best.plan == "deterministic" or instant.vss_with_recourse.mean == pytest.approx(0.0)
    page = reaction_page(rows, SETTINGS)
    assert page.count("| mission | 25 % |") == 6  # five tables over worlds, and the world's own row
    assert "| process | availability | never | station | report | instant |" in page
    assert "(`station`)" in page
    assert "stays at the base in all plans" not in page
    bare = [replace(row, by_news={news: found for news, found in row.by_news.items() if news != "station"},
                    last_stays=True) for row in rows]
    page = reaction_page(bare, SETTINGS)
    assert "station" not in page
    assert "In small the last robot stays at the base in all plans: it earns nothing there" in page


def test_a_world_without_scenarios_is_no_such_study(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    bare = replace(world, scenarios=(nominal_scenario(world),))
    assert bare.scenarios[0].name == NOMINAL
    with pytest.raises(BadInput, match="has no scenarios"):
        simulation([bare], SETTINGS, None, lambda *_: None)


@pytest.mark.parametrize(("arguments", "said"), [
    (["reproduce", "rewards", "worlds/maze.yaml"], "unexpected extra argument"),
    (["reproduce", "simulation", "nowhere.yaml"], "nowhere.yaml: no such file"),
    (["reproduce", "figures"], "'figures'"),
])
def test_what_cant_be_reproduced_is_refused(
        arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(arguments) == 2
    assert said in " ".join(capsys.readouterr().err.split())
