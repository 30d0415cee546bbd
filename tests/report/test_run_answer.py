"""What stands first on the page of a run: few lines, each with its name, and each fact once."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from sva_bench.analysis.results import Comparison, GivenPlanResult, Ranked
from sva_bench.analysis.scenarios import ComparedScenario
from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.report.main_tables import difference_table
from sva_bench.report.run_answer import answer_box, facts, unused
from sva_bench.report.wording import answer
from sva_bench.storage.stored_run import Content, read_content
from sva_bench.study.options import Options
from sva_bench.study.run import run
from tests.pages import plain
from tests.results_for_tests import NOTHING_MISSED, plan_result, summary
from tests.worlds_for_tests import SMALL, world_of

SPARE = SMALL.replace("scenarios:\n", """\
  spare:
    model: turtlebot2
    fuel_capacity_s: 60
    mission_limit_s: 120
    incentives: {p1: 0}
scenarios:
""")


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Content:
    """A run of three robots of which one earns nothing, under failures on the way."""
    folder = tmp_path_factory.mktemp("spare")
    options = Options(trials=40, rollouts=2, fidelity="kinematic")
    return read_content(run(world_of(folder, SPARE + "failure: per_leg\n"), options, folder / "runs", None,
                            lambda *_: None).folder)


def test_facts_of_one_name_stand_below_each_other_and_none_are_no_list() -> None:
    shown = facts(iter([("Caution", "few"), ("Unused", "uv1"), ("Caution", "fewer")]))
    assert shown == "<dl><dt>Caution</dt><dd>few</dd><dd>fewer</dd><dt>Unused</dt><dd>uv1</dd></dl>"
    assert facts(iter([])) == ""


def test_a_robot_that_no_plan_ever_uses_is_pointed_out_once(content: Content) -> None:
    assert unused(content) == ("spare stays home in every plan of every scenario: the mission comes to the same "
                               "without it.")
    assert plain("".join(answer_box(content))).count("spare stays home") == 1
    # New orders alone may send it, too.
    legs = replace(content.legs, robot=[*content.legs.robot[:-1], "spare"])
    assert unused(replace(content, legs=legs)) == ""
    # Of a robot that reaches no POI that is said already.
    reach = replace(NOTHING_MISSED, robots=("spare",), missed={"spare": ("p1",)})
    assert unused(replace(content, summary=replace(content.summary, reach=reach))) == ""


def test_robots_lost_are_told_as_a_range_over_scenarios_by_plan(content: Content) -> None:
    lost: dict[str, list[float]] = {}
    for (_, planner, *_), ended in content.counts.ended.items():
        lost.setdefault(planner, []).append(sum(
            found.share for found in ended if found.left and found.end in ("failed", "out_of_fuel", "stuck")))
    told = plain("".join(answer_box(content)))
    for name in ("stochastic", "deterministic"):
        least, most = f"{min(lost[name]):.2f}", f"{max(lost[name]):.2f}"
        assert f"{name} {most if least == most else f'{least}–{most}'}" in told
    assert "a mission, on average: they left the base and never came back." in told


def test_the_box_has_no_paragraph_but_the_headline_and_doubts(content: Content) -> None:
    box = "".join(answer_box(content))
    assert len(re.findall(r"<p[ >]", box)) == 1 + box.count("<p class=doubt>")
    assert "class=note" not in box


def compared(*differences: dict[tuple[str, str], float]) -> ComparisonSummary:
    """Given plans, so much apart in each scenario; what is less than 1 apart is not distinguishable."""
    names = list(dict.fromkeys(name for pair in differences[0] for name in pair))
    plans = {name: GivenPlanResult(**{**vars(plan_result(1.0)), "feasible": True, "lost": 0}) for name in names}
    scenarios = tuple(ComparedScenario(
        name=f"S{number}", availability={"uv1": 0.5}, plans=plans, comparisons=tuple(Comparison(
            a=a, b=b, mean=mean, ci95=(mean - 1, mean + 1), ci95_adjusted=(mean - 1, mean + 1),
            distinguishable=abs(mean) > 1, same_plan=False, verdict="") for (a, b), mean in pairs.items()),
        ranking=tuple(Ranked(rank=1, plan=name, mean=1.0) for name in names))
        for number, pairs in enumerate(differences, start=1))
    one = summary((1.0, 2.0), 1.0)
    return ComparisonSummary(**{key: getattr(one, key) for key in (
        "world", "seed", "trials", "rollouts", "fidelity", "failure", "travel", "reproducible", "reach")},
        scenarios=scenarios)


@pytest.mark.parametrize(("differences", "said"), [
    ([{("a", "b"): 4.0}, {("a", "b"): 3.0}], "a is worth more than b in S1 (4.0) and S2 (3.0)."),
    ([{("a", "b"): 4.0}, {("a", "b"): -3.0}],
     "a is worth more than b in S1 (4.0); b is worth more than a in S2 (3.0)."),
    ([{("a", "b"): 4.0}, {("a", "b"): 0.5}],
     "a is worth more than b in S1 (4.0). No other difference stands out of the noise."),
    ([{("a", "b"): 0.5}], "No difference between plans stands out of the noise.")])
def test_a_headline_names_each_pair_of_given_plans_once(differences: list[dict[tuple[str, str], float]], said: str
                                                       ) -> None:
    assert answer(compared(*differences)) == said


def test_one_pair_of_plans_is_named_once_above_its_differences_and_several_have_their_rows(content: Content) -> None:
    def shown(*pairs: dict[tuple[str, str], float]) -> str:
        found = compared(*pairs)
        scenarios = tuple(replace(each, name=of.name) for each, of in zip(
            found.scenarios, content.summary.scenarios, strict=False))
        return plain("".join(difference_table(replace(found, scenarios=scenarios))))

    one = shown({("a", "b"): 4.0}, {("a", "b"): 3.0})
    assert one.count("a less b, trial by trial") == 1
    assert "a − b".replace("−", "-") not in one
    three = shown({("a", "b"): 4.0, ("a", "c"): 3.0, ("b", "c"): 0.5})
    assert all(f"{pair}" in three for pair in ("a - b", "a - c", "b - c"))
    assert "by itself" in three
