"""Run folders of teams that react: rows, plans, recordings, the checks of what is read back, and trials again."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.analysis.summaries import Summary
from sva_bench.choices import News
from sva_bench.errors import BadFile, BadInput
from sva_bench.execution import plays
from sva_bench.execution.case import Case
from sva_bench.execution.team_outcome import Reaction
from sva_bench.files.records import as_dict
from sva_bench.mission.certify import certify
from sva_bench.mission.instance_file import read_instance
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_file import read_plan
from sva_bench.storage.run_folder import recording_stem
from sva_bench.storage.stored_run import read_content
from sva_bench.storage.tables import write_table
from sva_bench.study.options import Options
from sva_bench.study.publish import Run, report_again
from sva_bench.study.replay import Replayed, Wanted, replay
from sva_bench.study.run import run
from tests.worlds_for_tests import SMALL, world_of

# 30 s instead of 120 s, so that no robot can have all; robots may fail before each POI.
TEXT = SMALL.replace("limit_s: 120", "limit_s: 30").replace("name: small\n", "name: small\nfailure: per_leg\n")
HEARD: tuple[News, ...] = ("report", "instant")
WAITING = """
format: sva-bench/world@1
name: waiting
map: {shapes: {bounds_m: [0, 0, 8, 6]}}
sites:
  base: {at_m: [1, 1]}
  pois: {p1: {at_m: [1, 5]}, p2: {at_m: [6, 1]}}
robots:
  uv1: {model: turtlebot2, fuel_capacity_s: 60, mission_limit_s: 90, availability: 0.9, incentives: {p1: 20, p2: 25}}
  uv2: {model: turtlebot2, fuel_capacity_s: 60, mission_limit_s: 90, availability: 0.3, incentives: {p1: 20, p2: 25}}
noise: {wheel_gain_sd: 0.01}
"""


@pytest.fixture(scope="module", params=["enumerated", "sampled"])
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "world.yaml").write_text(TEXT, encoding="utf-8")
    options = Options(trials=40, rollouts=2, fidelity="kinematic", policies=("none", "resolve"), news=HEARD,
                      anticipate=True)
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "sampled":
            patch.setattr(plays, "MOST_HISTORIES", 1)
        yield run(world_of(folder, TEXT), options, folder / "runs", None, lambda *_: None)


@pytest.fixture
def folder(finished: Run, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished.folder, tmp_path / "run"))


def outcomes_of(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(folder / "outcomes.parquet").to_pylist()
    return rows


def reactions_of(finished: Run) -> list[tuple[tuple[str, str, str, str], Any]]:
    """Results by scenario, planner, policy and news."""
    assert isinstance(finished.summary, Summary)
    return [((s.name, name, r.policy, r.news), plan) for s in finished.summary.scenarios for r in s.reactions or ()
            for name, plan in r.plans.items()]


def test_weighted_means_of_the_rows_are_those_of_the_summary(finished: Run) -> None:
    rows, enumerated = outcomes_of(finished.folder), "enumerated" in str(finished.folder)
    for key, plan in reactions_of(finished):
        mine = [row for row in rows if (row["scenario"], row["planner"], row["policy"], row["news"]) == key]
        weight = sum(row["weight"] for row in mine) / 2  # a row for each of two robots
        assert weight == pytest.approx(1.0 if enumerated else 40)
        assert sum(row["weight"] * row["value"] for row in mine) / weight == pytest.approx(plan.executed.mean)
        # Histories are numbered under each noise draw, rows from nought on.
        assert [row["trial"] for row in mine[::2]] == list(range(len(mine) // 2))
        for draw in range(2) if enumerated else ():
            numbers = [row["history"] for row in mine[::2] if row["rollout"] == draw]
            assert numbers == list(range(len(numbers)))
    alone = [row for row in rows if row["policy"] == "none"]
    assert {(row["news"], row["history"], row["weight"]) for row in alone} == {("never", -1, 1.0)}
    assert len(alone) == 2 * 2 * 40 * 2  # scenarios, plans, trials, robots


def test_each_leg_of_a_reaction_is_there_once_under_each_noise_draw_in_a_trial_that_drove_it(finished: Run) -> None:
    legs = pq.read_table(finished.folder / "legs.parquet").to_pylist()
    names = ("scenario", "planner", "policy", "news", "rollout", "robot", "origin", "destination")
    reacting = [tuple(leg[name] for name in names) for leg in legs if leg["policy"] != "none"]
    assert len(set(reacting)) == len(reacting) > 0
    rows = {(*(row[name] for name in names[:4]), row["trial"], row["robot"]): row
            for row in outcomes_of(finished.folder)}
    for leg in legs:
        row = rows[(*(leg[name] for name in names[:4]), leg["trial"], leg["robot"])]
        assert row["rollout"] == leg["rollout"]
        if leg["policy"] != "none":
            assert leg["leg"] <= row["stops_reached"]  # it was on its way there at least
        assert abs(leg["driven_s"] - leg["planned_s"]) < 0.05 * leg["planned_s"]


def test_plans_made_for_a_reaction_are_kept_and_can_be_certified_and_executed(
        finished: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for key, result in reactions_of(finished):
        if key[1] == "anticipative":
            path = finished.folder / "plans" / f"{key[0]}-anticipative-{key[3]}.json"
            instance = read_instance(finished.folder / f"instance-{key[0]}.json")
            plan = read_plan(path, instance)
            assert plan.objective == "anticipative"
            if "enumerated" in str(finished.folder):  # else it was chosen by other trials than it was measured on
                assert plan.value == pytest.approx(result.modelled)
            found = certify(instance, plan)
            assert (found.feasible, found.reasons) == (True, ())  # a value with the reaction is no closed form
    monkeypatch.chdir(tmp_path)
    (tmp_path / "world.yaml").write_text(TEXT, encoding="utf-8")
    plans = [str(finished.folder / "plans" / f"half-anticipative-{news}.json") for news in HEARD]
    assert run_command_line(["execute", "world.yaml", *plans, "--policy", "resolve", "--news", "report", "--trials",
                             "4", "--rollouts", "1", "--fidelity", "kinematic", "--workers", "1"]) == 0
    (given,) = (tmp_path / "runs").iterdir()
    assert read_content(given).lacking == ()
    assert {row["policy"] for row in outcomes_of(given)} == {"none", "resolve"}


def test_a_folder_holds_a_recording_of_each_plan_that_reacts_and_no_other(finished: Run) -> None:
    told = {recording_stem(key, foreign=False) for key, plan in reactions_of(finished) if plan.reacted > 0}
    assert told  # robots that may fail do so in some history
    alone = {f"{scenario}-{planner}" for scenario, planner in product(
        ("half", "safe"), ("stochastic", "deterministic"))}
    assert {path.stem for path in (finished.folder / "recordings").iterdir()} == told | alone
    content = read_content(finished.folder)
    assert (content.lacking, set(content.reaction_stems.values())) == ((), told)


@pytest.mark.spread(2)
def test_the_page_is_written_again_from_the_tables(folder: Path) -> None:
    before = (folder / "report.html").read_bytes()
    assert report_again(folder).read_bytes() == before
    next((folder / "recordings").glob("*+resolve-report.rrd")).unlink()
    assert any("+resolve-report.rrd" in name for name in read_content(folder).lacking)


def changed(column: str, value: Any, policy: str = "resolve") -> Callable[[pa.Table], pa.Table]:
    """A table whose first row of a policy holds another value in a column."""
    def change(table: pa.Table) -> pa.Table:
        values = table.column(column).to_pylist()
        values[table.column("policy").to_pylist().index(policy)] = value
        return table.set_column(table.schema.get_field_index(column), table.schema.field(column),
                                pa.array(values, table.schema.field(column).type))

    return change


@pytest.mark.parametrize(("change", "column"), [
    (changed("value", 1e6), "value"), (changed("incentive", 1e6), "incentive"),
    (changed("weight", 0.9), ("weight", "trial")), (changed("history", 7, "none"), "trial"),
    (changed("news", "station"), "policy"),
    (lambda table: table.filter(pc.not_equal(table.column("planner"), "anticipative")), ("weight", "trial", ""))])
def test_rows_that_do_not_agree_with_the_summary_are_refused(
        change: Callable[[pa.Table], pa.Table], column: str | tuple[str, ...], folder: Path) -> None:
    path = folder / "outcomes.parquet"
    table = pq.read_table(path)
    write_table(path, table.schema, [change(table)])
    with pytest.raises(BadFile) as refused:
        read_content(folder)
    assert refused.value.path == str(path)
    assert refused.value.key in ([column] if isinstance(column, str) else column)


@pytest.mark.parametrize("change", [
    lambda rows: rows[1].update(history=77), lambda rows: rows[1].update(history=0),
    lambda rows: rows[1].update(rollout=1 - rows[1]["rollout"]),
    lambda rows: rows[-1].update(robot="uv1")])  # twice for one robot, and missing of the other
def test_histories_are_numbered_without_gaps_once_for_each_robot(
        change: Callable[[list[dict[str, Any]]], None], folder: Path) -> None:
    if "enumerated" not in (folder / "summary.json").read_text():
        pytest.skip("sampled trials have no numbers of histories")
    path = folder / "outcomes.parquet"
    rows = outcomes_of(folder)
    change([row for row in rows if row["policy"] == "resolve" and row["robot"] == "uv2"])
    schema = pq.read_schema(path)
    write_table(path, schema, [pa.Table.from_pylist(rows, schema=schema)])
    with pytest.raises(BadFile) as refused:
        read_content(folder)
    assert refused.value.key == "history"


def test_a_plan_made_for_a_reaction_that_was_not_the_one_driven_is_refused(folder: Path) -> None:
    if "enumerated" not in (folder / "summary.json").read_text():
        pytest.skip("only in an enumerated trial 0 it is known that nothing happens")
    path = folder / "plans" / "half-anticipative-report.json"
    plan = json.loads(path.read_text())
    robot = next(name for name, route in plan["routes"].items() if len(route) > 2)
    plan["routes"][robot] = ["base", *reversed(plan["routes"][robot][1:-1]), "base"] \
        if len(plan["routes"][robot]) > 3 else []
    path.write_text(json.dumps(plan))
    with pytest.raises(BadFile, match="not the route that was driven in trial 0"):
        read_content(folder)


@pytest.mark.spread(1)
def test_every_trial_and_history_replayed_gives_its_rows_to_the_bit(folder: Path) -> None:
    rows = outcomes_of(folder)
    keys = dict.fromkeys((row["scenario"], row["policy"], row["news"]) for row in rows)
    for number, (scenario, policy, news) in enumerate(keys):
        mine = [row for row in rows if (row["scenario"], row["policy"], row["news"]) == (scenario, policy, news)]
        most = min(max(row["trial"] for row in mine if row["planner"] == name)
                   for name in ("stochastic", "deterministic"))
        for planner, trial in (("stochastic", most), ("deterministic", number % (most + 1))):
            (found,) = replay(folder, Wanted(scenario=scenario, trial=trial, planner=planner, policy=policy,
                                             news=None if policy == "none" else news), None, lambda *_: None)
            assert list(found.rows) == [row for row in mine if (row["planner"], row["trial"]) == (planner, trial)]
            assert found.recording
            assert found.recording.is_file()
    assert read_content(folder).lacking == ()  # recordings beside those of the run are no harm


@pytest.mark.parametrize(("wanted", "said"), [
    (Wanted(scenario=None, trial=0), "--scenario: the run has several; name one of half, safe"),
    (Wanted(scenario="hlaf", trial=0), "did you mean 'half'"),
    (Wanted(scenario="half", trial=100_000), "--trial 100000: half, stochastic has no such trial; the first is 0, the "
     "last 39"),
    (Wanted(scenario="half", trial=0, planner="anticipative"),
     "--planner anticipative: this plan was made for a reaction; add --policy resolve"),
    (Wanted(scenario="half", trial=0, planner="nobody"), "--planner 'nobody'"),
    (Wanted(scenario="half", trial=0, policy="resolve"), "--news: the run has several; name one of report, instant"),
    (Wanted(scenario="half", trial=0, policy="resolve", news="station"),
     "--news station: not measured with resolve; the run has report, instant"),
    (Wanted(scenario="half", trial=0, policy="resolve", news="never"), "leave out --policy"),
    (Wanted(scenario="half", trial=0, news="report"), "nobody reacts to it without a policy")])
def test_what_the_run_does_not_hold_is_not_replayed(wanted: Wanted, said: str, finished: Run) -> None:
    with pytest.raises(BadInput) as refused:
        replay(finished.folder, wanted, None, lambda *_: None)
    assert said in str(refused.value)


@pytest.mark.spread(2)
def test_the_command_prints_the_rows_of_each_plan(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["replay", str(folder), "--scenario", "half", "--trial", "1", "--policy", "resolve", "--news", "report"]
    assert run_command_line([*words, "--json", "--workers", "1"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["format"] == "sva-bench/replay@1"
    assert said["rows"] == [row for row in outcomes_of(folder) if (
        row["scenario"], row["policy"], row["news"], row["trial"]) == ("half", "resolve", "report", 1)]
    assert run_command_line([*words, "--planner", "stochastic", "--workers", "1"]) == 0
    assert capsys.readouterr().out.startswith("half, stochastic, uv1: ")


def test_a_replay_says_what_was_heard_when_and_how_orders_changed(
        folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key, trial = next(((row["scenario"], row["planner"], row["news"]), row["trial"]) for row in outcomes_of(folder)
                      if row["policy"] == "resolve" and row["end"] == "failed")
    words = ["replay", str(folder), "--scenario", key[0], "--planner", key[1], "--policy", "resolve", "--news", key[2],
             "--trial", str(trial), "--workers", "1"]
    assert run_command_line([*words, "--json"]) == 0
    heard = json.loads(capsys.readouterr().out)["reactions"]
    assert heard
    assert all(set(each) == {"scenario", "planner", "policy", "news", "time_s", "failed", "learned", "orders"}
               for each in heard)
    assert run_command_line(words) == 0
    said = capsys.readouterr().out
    for each in heard:
        (who,) = re.findall(rf"at {each['time_s']:.1f} s (.*) learned that {', '.join(each['failed'])} failed", said)
        gone = re.findall(r"  (\S+) \(.*, unknown to the team\) was told, and hears nothing", said)
        assert set(who.split(", ")) - {"nobody"} <= set(each["learned"]) <= {*who.split(", "), *gone}
    said = said.replace(" (failed, unknown to the team)", "")
    for each in heard:
        for robot, orders in each["orders"].items():
            assert f"{robot}, from {orders['since']}: " in said
            assert "now " + (" → ".join(orders["after"]) or "no orders") in said
    assert run_command_line([*words[:6], "--trial", "0", "--workers", "1"]) == 0
    assert "heard" not in capsys.readouterr().out


@pytest.mark.parametrize(("ends", "learned", "said"), [
    ((("home", 9.0), ("failed", 1.0)), (),
     "nobody learned that uv2 failed; nobody could be told: uv1 is on its way home"),
    ((("home", 4.0), ("failed", 1.0)), (), "nobody learned that uv2 failed; nobody could be told: uv1 is home"),
    ((("failed", 9.0), ("failed", 1.0)), ("uv1",), "uv1 learned that uv2 failed; no orders changed"),
    ((("failed", 4.0), ("failed", 1.0)), ("uv1",),
     "nobody learned that uv2 failed; no orders changed\n"
     "  uv1 (failed, unknown to the team) was told, and hears nothing"),
    ((("out_of_fuel", 4.0), ("failed", 1.0)), (), "nobody learned that uv2 failed; nobody could be told: uv1 (out of "
     "fuel, unknown to the team) is on its way home")])
def test_a_replay_says_who_could_not_be_told_and_who_is_lost_without_being_missed(
        ends: Sequence[tuple[str, float]], learned: tuple[str, ...], said: str, tmp_path: Path) -> None:
    rows = [{"robot": robot, "end": end, "end_time_s": at, "lost": end != "home"}
            for robot, (end, at) in zip(("uv1", "uv2"), ends, strict=True)]
    case = Case(scenario=world_of(tmp_path, TEXT).scenarios[0], planner="p", plan=Plan(routes={}), policy="resolve",
                news="report")
    heard = Reaction(time_s=5.0, failed=("uv2",), learned=learned, before={}, after={})
    told = Replayed(case=case, rows=rows, recording=tmp_path, reactions=[heard]).told()
    assert "\n".join(told) == f"at 5.0 s {said}"


@pytest.mark.parametrize(("foreign", "planners"), [
    (False, ["stochastic", "deterministic", "anticipative"]),
    (True, ["stochastic", "a", "a+resolve-report", "resolve-report+a", "@resolve-report+a", "+", "trial1",
            "a+trial1"])])
def test_no_two_recordings_of_a_folder_share_a_name(foreign: bool, planners: list[str]) -> None:
    scenarios = ["S", "S-stochastic", "S-resolve-report", "S-a"]
    reactions = [("none", "never"), ("resolve", "report"), ("resolve", "instant")]
    stems = [recording_stem((scenario, planner, policy, news), trial, foreign=foreign)
             for scenario, planner, (policy, news), trial in product(scenarios, planners, reactions, (None, 1, 11))]
    assert len(set(stems)) == len(stems)


@pytest.mark.spread(1)
def test_a_run_is_the_same_whether_it_reacts_beside_or_not(finished: Run, tmp_path: Path) -> None:
    options = Options(trials=40, rollouts=2, fidelity="kinematic")
    alone = run(world_of(tmp_path, TEXT), options, tmp_path / "runs", None, lambda *_: None)
    assert alone.folder.name != finished.folder.name
    assert outcomes_of(alone.folder) == [row for row in outcomes_of(finished.folder) if row["policy"] == "none"]
    assert isinstance(finished.summary, Summary)
    for told, kept in zip(as_dict(alone.summary)["scenarios"], as_dict(finished.summary)["scenarios"], strict=True):
        assert told == {key: value for key, value in kept.items() if key != "reactions"}


def test_a_robot_that_is_sent_out_from_the_base_and_fails_at_once_is_recorded(tmp_path: Path) -> None:
    # uv1 takes both POIs and uv2, which is seldom there, waits; missing from the start, uv1 is replaced by uv2.
    world = world_of(tmp_path, WAITING)
    finished = run(world, Options(trials=4, rollouts=1, fidelity="kinematic", policies=("resolve",)),
                   tmp_path / "runs", None, lambda *_: None)
    sent = [row for row in outcomes_of(finished.folder) if row["policy"] == "resolve" and row["end"] == "failed"
            and row["end_time_s"] > 0]
    assert sent, "uv2 was to be sent out, and to fail in some history"
    for row in sent:
        wanted = Wanted(scenario=None, trial=row["trial"], planner=row["planner"], policy="resolve")
        (found,) = replay(finished.folder, wanted, None, lambda *_: None)
        assert found.recording
        assert found.recording.is_file()
    assert read_content(finished.folder).lacking == ()
