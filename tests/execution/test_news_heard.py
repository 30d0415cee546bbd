"""Who learns of a failure, as recordings tell it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.choices import End
from sva_bench.execution.outcome import Outcome, RobotFate
from sva_bench.execution.team_outcome import Reaction, TeamOutcome
from sva_bench.execution.team_trace import news_of
from sva_bench.study.costs import plan_costs
from tests.worlds_for_tests import world_of


def outcome_of(end: End, end_time_s: float) -> Outcome:
    return Outcome(available=end != "failed", incentive=0.0, lost=end not in ("home", "late"), value=0.0,
                   pois_reached=0, stops_reached=0, end=end, end_time_s=end_time_s, fuel_used_s=0.0, driven_s=0.0,
                   waited_s=0.0, contacts=0, events=())


@pytest.mark.parametrize(("end", "end_time_s", "learns"), [
    ("failed", 4.0, False), ("out_of_fuel", 4.0, False), ("stuck", 5.0, False),
    ("failed", 6.0, True), ("home", 4.0, True), ("late", 4.0, True)])
def test_a_robot_that_is_lost_by_then_learns_nothing(end: End, end_time_s: float, learns: bool, tmp_path: Path) -> None:
    world = world_of(tmp_path)
    heard = Reaction(time_s=5.0, failed=("uv2",), learned=("uv1",), before={}, after={})
    mission = TeamOutcome(
        robots=(outcome_of(end, end_time_s), outcome_of("failed", 1.0)), stops=(("base",), ("base",)),
        reactions=(heard,), fates=(RobotFate(), RobotFate()), left_over=((), ()), doubled=0)
    (news,) = news_of(world, plan_costs(world, "prmstar", lambda *_: None), mission)
    assert news.learned == (("uv1",) if learns else ())
