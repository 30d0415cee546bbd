"""What cannot be reached, and plans that break their limits, are told on terminal, page and in the summary."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from sva_bench.analysis.reach import beyond_reach, maps_without_reach, reached, unused_told, why_nothing
from sva_bench.analysis.summaries import ComparisonSummary, Reach
from sva_bench.cli.tables import print_summary
from sva_bench.study.compare import execute_plans
from sva_bench.study.costs import plan_costs
from sva_bench.study.given_plans import read_plans
from sva_bench.study.options import Options
from sva_bench.study.planning import check_plans
from sva_bench.study.publish import Run
from sva_bench.study.run import run
from tests.cli.test_commands import world_file
from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL, world_of

QUICK = Options(trials=20, rollouts=2, fidelity="kinematic")
NOTHING = "no robot reaches any POI: give them more fuel or time"
DRY = SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 1")


def run_of(folder: Path, text: str) -> Run:
    return run(world_of(folder, text), QUICK, folder / "runs", None, lambda *_: None)


def told(done: Run, capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    """What terminal and page say, on one line each."""
    capsys.readouterr()
    print_summary(done.summary)
    return tuple(" ".join(text.split()) for text in (  # type: ignore[return-value]
        capsys.readouterr().out, (done.folder / "report.html").read_text()))


def test_where_no_poi_is_reachable_table_page_summary_and_check_agree(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = run_of(tmp_path, DRY)
    assert done.summary.reach == Reach(
        nothing=True, robots=("uv1", "uv2"), pois=("p1", "p2", "p3", "p4"),
        missed=dict.fromkeys(("uv1", "uv2"), ("p1", "p2", "p3", "p4")))
    for text in told(done, capsys):
        assert NOTHING in text
        assert "changes nothing here" not in text
        assert "is best either way" not in text
    checked = sva_bench("world", "check", world_file(tmp_path, DRY), cwd=tmp_path)
    assert NOTHING in " ".join(checked.stdout.split())


@pytest.mark.parametrize(("pois", "said"), [
    (False, "no POI earns a robot anything: add some under sites.pois, and give robots incentives there"),
    (True, "no robot earns anything where it can go: give it incentives there")])
def test_where_there_is_nothing_to_earn_it_is_not_for_want_of_fuel(
        pois: bool, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = re.sub(r"incentives: {.*}", "incentives: {}", SMALL)
    if not pois:
        text = re.sub(r"  pois:\n(    p.*\n)*", "  pois: {}\n", text)
    for told_there in told(run_of(tmp_path, text), capsys):
        assert f"There is nothing to compare, for {said}." in told_there
        assert "fuel or time" not in told_there


def test_where_nothing_is_reached_nor_would_earn_anything_more_fuel_is_no_advice() -> None:
    found = reached({"a": ["p"], "b": ["p"]}, ["a", "b"], ["p"], {"a": [], "b": []})
    assert found.nothing
    assert why_nothing(found) == \
        "no POI earns a robot anything: add some under sites.pois, and give robots incentives there"
    assert why_nothing(reached({"a": ["p"], "b": ["p"]}, ["a", "b"], ["p"], {"a": [], "b": ["p"]})) == NOTHING


@pytest.mark.parametrize("limit", ["mission_limit_s: 120", "fuel_capacity_s: 60"])
def test_a_robot_that_reaches_nothing_is_named(
        limit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = run_of(tmp_path, SMALL.replace(limit, limit.split()[0] + " 1", 1))
    assert done.summary.reach.robots == ("uv1",)
    for text in told(done, capsys):
        assert "uv1 reaches no POI within its fuel and limit, and stays home." in text
        assert NOTHING not in text


def test_pois_that_no_robot_reaches_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # p3 is the remotest: 30 s of driving suffice for the others, there and back.
    done = run_of(tmp_path, SMALL.replace("mission_limit_s: 120", "mission_limit_s: 24"))
    missed = done.summary.reach.pois
    assert missed
    assert len(missed) < 4
    for text in told(done, capsys):
        assert f"No robot reaches {' and '.join(missed)}." in text


def test_a_robot_that_no_plan_uses_is_pointed_out_and_no_other(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    idle = re.sub(r"(?s)(  uv2:.*?)incentives: {.*?}", r"\1incentives: {}", SMALL)
    done = run_of(tmp_path, idle)
    assert done.unused == ("uv2",)
    capsys.readouterr()
    print_summary(done.summary, unused=done.unused)
    assert "uv2 stays home in every plan." in capsys.readouterr().out
    assert run_of(tmp_path, SMALL).unused == ()
    # One that reaches nothing is said to stay home already.
    unable = run_of(tmp_path, SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 1", 1))
    assert unable.unused == ("uv1",)
    assert unused_told(unable.unused, unable.summary) == []


def test_where_all_pois_are_reachable_there_is_no_warning(tmp_path: Path) -> None:
    done = run_of(tmp_path, SMALL)
    assert done.summary.reach == Reach(nothing=False, robots=(), pois=(), missed={})
    assert beyond_reach(done.summary.reach) == []


@pytest.mark.long
def test_pois_at_which_a_robot_would_earn_nothing_are_not_missed(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Nobody reaches any of the two; uv1 would earn something at p1 alone, and uv2 nowhere.
    both = {robot: ["p1", "p2"] for robot in ("uv1", "uv2")}
    found = reached(both, ["uv1", "uv2"], ["p1", "p2", "p3"], {"uv1": ["p1", "p3"]})
    assert (found.missed, found.pois) == ({"uv1": ("p1",)}, ("p1",))
    # uv1 has the fuel for the nearest POIs, and earns nothing at those that it doesn't reach.
    missed = run_of(tmp_path, SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 16", 1)).summary.reach.missed
    assert missed
    (robot, pois), = missed.items()
    text = SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 16", 1)
    for poi in pois:
        text = re.sub(rf"({robot}:\n.*?incentives: {{.*?){poi}: \d+", rf"\g<1>{poi}: 0", text, flags=re.DOTALL)
    for said in told(run_of(tmp_path, text), capsys):
        assert "within its fuel and limit" not in said


def test_many_pois_are_counted_not_listed() -> None:
    pois = [f"p{k}" for k in range(50)]
    said = beyond_reach(reached({"uv1": pois[:40]}, ["uv1", "uv2"], pois))
    assert said == [f"uv1 reaches none of {', '.join(pois[:20])} and 20 more within its fuel and limit, and will never "
                    "be sent there."]


@pytest.mark.long
def test_a_map_of_a_batch_where_nothing_is_reached_is_named(tmp_path: Path) -> None:
    (tmp_path / "dry.yaml").write_text(DRY.replace("name: small", "name: dry"))
    quick = ("--trials", 20, "--rollouts", 2, "--fidelity", "kinematic", "--workers", 1, "--cache", tmp_path / "cache")
    done = sva_bench("batch", world_file(tmp_path), tmp_path / "dry.yaml", *quick, "--out", "b", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = f"On 1 map (dry) {NOTHING}, or leave it out."
    assert said in " ".join(done.stdout.split())
    assert said in (tmp_path / "b" / "report.html").read_text()
    units = json.loads((tmp_path / "b" / "summary.json").read_text())["units"]
    assert {unit["world"]: unit["reach"]["nothing"] for unit in units} == {"small": False, "dry": True}
    assert maps_without_reach([]) == []


def executed(folder: Path, plans: dict[str, dict[str, list[str]]]) -> Run:
    """Plans executed, whether they keep within fuel and limit or not."""
    world = world_of(folder, SMALL.replace("fuel_capacity_s: 60", "fuel_capacity_s: 30").replace("{uv2: 0.5}",
                                                                                                  "{uv2: 0.0}"))
    paths = {}
    for name, routes in plans.items():
        paths[name] = folder / f"{name}.json"
        paths[name].write_text(json.dumps({"format": "sva-bench/plan@1", "routes": routes}))
    costs = plan_costs(world, "prmstar", lambda *_: None)
    read = read_plans(world, paths)
    check_plans(world, costs, read, paths, allow_infeasible=True)
    return execute_plans(world, read, QUICK, folder / "runs", None, lambda *_: None, costs)


def test_an_infeasible_plan_is_marked_before_its_figure(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = executed(tmp_path, {"dry": {"uv1": ["base", "p1", "p2", "p3", "p4", "base"]}, "good": {"uv1": [
        "base", "p1", "base"], "uv2": ["base", "p4", "base"]}})
    assert isinstance(done.summary, ComparisonSummary)
    plans = done.summary.scenarios[0].plans
    # Robots: uv1 runs dry in each of 20 trials, uv2 stays home. A robot that fails at the base is not lost on the way.
    assert {name: (plan.feasible, plan.lost) for name, plan in plans.items()} == {
        "dry": (False, 20), "good": (True, 0)}
    assert plans["good"].ends["failed"] == 20
    terminal, page = told(done, capsys)
    assert "dry (infeasible, 20 of 40 robot missions lost) " in terminal
    assert ">dry (infeasible)</td>" in page
    assert "<b>dry (infeasible)</b>" in page  # over its map
    assert "</title>dry (infeasible)</text>" in page  # at its bars
    for text in (terminal, page):
        assert "dry is infeasible: fuel or mission limit would be broken." in text
        assert "good (" not in text.split("dry is infeasible")[0].split("nominal")[0]
    assert "dry (infeasible) 20 of 40" in terminal


def test_help_says_what_allow_infeasible_covers(tmp_path: Path) -> None:
    said = " ".join(sva_bench("execute", "--help", cwd=tmp_path).stdout.replace("│", " ").split())
    assert "break fuel capacity or mission limit" in said
    assert "unknown sites" in said
