"""Worlds in which robots meet: costs of each robot by itself, and what they did to each other in a whole run."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import sva_bench as sb
from sva_bench.__main__ import run_command_line
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.strands import strand
from sva_bench.choices import Interaction
from sva_bench.errors import BadFile, BadInput
from sva_bench.execution.executed import Executed, LegTime
from sva_bench.execution.meetings import Meetings
from sva_bench.execution.outcome import Wait
from sva_bench.execution.touch import Touch
from sva_bench.storage.stored_run import read_content, write_csv
from sva_bench.study.costs import grounds_of, instance_of, plan_costs
from sva_bench.study.options import Options, settings_of
from sva_bench.study.publish import Run, report_again
from sva_bench.study.run import measure, publish_run
from sva_bench.study.summing import head_of, summarise
from sva_bench.travel.berths import place_berths
from sva_bench.world.model import World
from tests.worlds_for_tests import SMALL, world_of

SHARED = SMALL.replace("stop_s: 4}", "stop_s: 4, slots: 2}") + "interaction: shared\n"
MET = {"contacts": 0.5, "waited_s": 3.75, "detours": 0.25, "exact_share": 0.75}


def quiet(*_: object) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Finished:
    """A run of robots that meet."""

    world: World
    run: Run


def met(run: Executed) -> Executed:
    """The same with what robots did to each other: in 4 trials waits of 15 s, 2 contacts, a detour, and 3 exact."""
    assert len(run.end) == 4
    leg = run.legs[0]
    told = replace(leg, waits=(Wait(leg=leg.leg, lasts_s=7.5, x_m=2.0, y_m=1.0, cause="uv2", since_s=0.0),),
                   waited_s=7.5, touches=(a_touch(leg),))
    return replace(run, legs=(told, *run.legs[1:]), meetings=Meetings(
        contacts=np.array([0, 2, 0, 0]), waited_s=np.array([7.5, 7.5, 0.0, 0.0]), detours=np.array([0, 0, 1, 0]),
        exact=np.array([True, True, True, False])))


def a_touch(leg: LegTime) -> Touch:
    return Touch(leg=leg.leg, since_s=0.5, lasted_s=0.25, x_m=2.0, y_m=1.0, solid="uv2")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    folder = tmp_path_factory.mktemp("shared")
    world = world_of(folder, SHARED)
    options = Options(trials=4, rollouts=2, fidelity="kinematic")
    done = measure(world, options, None, quiet)
    executed = [met(run) for run in done.executed]
    head = head_of(world, settings_of(world, options), done.costs, reproducible=True)
    summary = summarise(world, options, head, done.planned, executed, done.summary.reach)
    return Finished(world=world, run=publish_run(
        world, options, replace(done, executed=executed, summary=replace(summary, drives=done.summary.drives)),
        folder / "runs", quiet))


# Costs


def test_each_robot_leaves_from_its_own_berth_and_keeps_off_those_of_others(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    berths = place_berths(world)
    costs = plan_costs(world, "prmstar", quiet)
    assert list(costs) == ["uv1", "uv2"]
    for number, robot in enumerate(world.robots):
        times = costs[robot.name].times
        assert_allclose(times.path("base", "p1")[0], berths[number], atol=1e-9)
        assert_allclose(times.path("p3", "base")[-1], berths[number], atol=1e-9)
        other = np.array(berths[1 - number])
        clear = [np.hypot(*(times.path(a, b) - other).T).min() for a in times.sites for b in times.sites if a != b]
        assert min(clear) > 2 * robot.model.radius_m


def test_instances_hold_the_costs_of_each_robot(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    costs = plan_costs(world, "prmstar", quiet)
    vehicles = instance_of(world, costs, world.scenarios[0]).vehicles
    for vehicle in vehicles:
        assert_array_equal(vehicle.fuel_s, costs[vehicle.name].cost_s)
    assert not np.array_equal(vehicles[0].fuel_s, vehicles[1].fuel_s)


@pytest.mark.parametrize("text", [SMALL, SMALL + "interaction: independent\n"])
def test_robots_that_do_not_meet_share_what_their_model_takes(text: str, tmp_path: Path) -> None:
    world = world_of(tmp_path, text)
    (ground,) = grounds_of(world).values()
    assert ground.world is world
    assert list(plan_costs(world, "prmstar", quiet)) == ["turtlebot2"]


def test_a_batch_plans_what_a_run_plans(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    grid = Grid(points=[Point(world=world, planner="prmstar", variant="")], seeds=(0,), options=Options(trials=2),
                unit_trials=10)
    jobs = list(next(strand(grid, grid.points[0], 0, frozenset())))
    assert len({job.key for job in jobs}) == len(jobs) == 2
    alone = plan_costs(world, "prmstar", quiet)
    for job, cost in zip(jobs, alone.values(), strict=True):
        times = job.run()
        assert_array_equal(times.time_ms, cost.times.time_ms)
        assert job.fits(times)


def test_costs_given_in_python_are_those_of_each_robot(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    times = sb.travel_times(world)
    costs = sb.fuel_costs(world, times=times)
    assert list(times) == list(costs) == ["uv1", "uv2"]
    assert_array_equal(sb.make_instance(world, costs=costs).vehicles[1].fuel_s, costs["uv2"].cost_s)
    with pytest.raises(BadInput, match="nothing for the robot uv1 of small"):
        sb.fuel_costs(world, times=sb.travel_times(replace(world, interaction="independent")))
    with pytest.raises(BadInput, match="make them for this world"):  # each has the other's
        sb.fuel_costs(world, times={"uv1": times["uv2"], "uv2": times["uv1"]})
    with pytest.raises(ValueError, match="by the name of the robot, found"):
        sb.fuel_costs(world, times=3)  # type: ignore[arg-type]


# Names of runs, and ways to ask


@pytest.mark.spread(1)
@pytest.mark.parametrize("interaction", ["independent", "uncoordinated", "shared"])
def test_an_option_gives_the_run_of_a_world_that_says_so_itself(interaction: Interaction, tmp_path: Path) -> None:
    told = world_of(tmp_path, f"{SMALL}interaction: {interaction}\n")
    mine = sb.load_world(tmp_path / "world.yaml", interaction=interaction)
    plain = world_of(tmp_path)
    names = {sb.run(world, trials=2, rollouts=1, fidelity="kinematic", workers=1, interaction=asked, scenario="safe",
                    out=tmp_path / f"runs{k}").folder.name  # type: ignore[union-attr]
             for k, (world, asked) in enumerate(((told, None), (mine, None), (plain, interaction)))}
    assert len(names) == 1
    # And what says nothing goes by the name that it always had.
    silent = sb.run(plain, trials=2, rollouts=1, fidelity="kinematic", workers=1, scenario="safe",
                    out=tmp_path / "runs").folder
    assert silent is not None
    assert (silent.name in names) == (interaction == "independent")


def test_a_run_is_of_the_world_that_its_manifest_holds(finished: Finished) -> None:
    assert json.loads((finished.run.folder / "manifest.json").read_text())["world"]["interaction"] == "shared"
    assert read_content(finished.run.folder).world.meets


@pytest.mark.parametrize("word", ["joint", "", "Shared"])
def test_an_unknown_interaction_is_refused_in_python(word: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="interaction"):
        sb.run(world_of(tmp_path), interaction=word)  # type: ignore[arg-type]


@pytest.mark.parametrize("command", ["run", "execute", "batch", "world check"])
def test_commands_take_it_and_refuse_what_there_is_not(command: str, tmp_path: Path,
                                                      capsys: pytest.CaptureFixture[str]) -> None:
    world_of(tmp_path)
    (tmp_path / "plan.json").write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {}}))
    plans = [str(tmp_path / "plan.json")] if command == "execute" else []
    words = [*command.split(), str(tmp_path / "world.yaml"), *plans, "--interaction", "joint"]
    assert run_command_line(words) == 2
    assert "is not one of 'independent', 'uncoordinated', 'shared'" in " ".join(capsys.readouterr().err.split())


# What robots did to each other


def test_the_summary_says_what_robots_did_to_each_other(finished: Finished) -> None:
    told = json.loads((finished.run.folder / "summary.json").read_text())
    for scenario in told["scenarios"]:
        for plan in scenario["plans"].values():
            assert plan["interaction"] == MET
    assert read_content(finished.run.folder).summary == finished.run.summary


def test_a_page_has_their_section_and_is_the_same_again(finished: Finished) -> None:
    path = finished.run.folder / "report.html"
    page = path.read_bytes()
    text = page.decode()
    assert "Robots in one world" in text
    assert "Interaction shared: they drive in one world, coordinated" in text
    assert "<title>berth of uv1</title>" in text
    assert "<title>slot of " in text
    for figure in ("0.50", "3.8", "0.25", "75.0"):
        assert f">{figure}<" in text
    report_again(finished.run.folder)
    assert path.read_bytes() == page


def test_waits_and_contacts_name_the_other_robot(finished: Finished) -> None:
    waits, touched = (pq.read_table(finished.run.folder / f"{name}.parquet") for name in ("waits", "contacts"))
    assert set(touched["solid"].to_pylist()) == {"uv2"}
    assert "uv2" in waits["cause"].to_pylist()
    assert set(waits["cause"].to_pylist()) <= {"uv1", "uv2"}
    text = (finished.run.folder / "report.html").read_text()
    assert "What robots waited for" in text
    assert "in all [s]" in text
    assert "missions alike are played once" in text


@pytest.mark.parametrize(("name", "column"), [("waits", "cause"), ("contacts", "solid")])
def test_a_robot_that_is_none_of_the_world_is_no_cause(name: str, column: str, finished: Finished) -> None:
    path = finished.run.folder / f"{name}.parquet"
    kept = path.read_bytes()
    rows = pq.read_table(path)
    words = pa.array(["uv7"] * rows.num_rows)
    try:
        pq.write_table(rows.set_column(rows.schema.get_field_index(column), rows.schema.field(column), words), path)
        with pytest.raises(BadFile, match="'uv7' is unknown"):
            read_content(finished.run.folder)
    finally:
        path.write_bytes(kept)


def test_travel_times_are_of_each_robot(finished: Finished) -> None:
    rows = pq.read_table(finished.run.folder / "travel_times.parquet")
    assert set(rows["model"].to_pylist()) == {"uv1", "uv2"}
    assert rows.num_rows == 2 * 6 * 5


def test_a_table_for_spreadsheets_is_written_where_robots_meet(finished: Finished, tmp_path: Path) -> None:
    assert "interaction.csv" in {path.name for path in write_csv(finished.run.folder)}
    with (finished.run.folder / "interaction.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["scenario"], row["planner"]) for row in rows] == [
        (scenario, plan) for scenario in ("half", "safe") for plan in ("stochastic", "deterministic")]
    assert {key: float(rows[0][key]) for key in MET} == MET
    plain = sb.run(world_of(tmp_path), trials=2, rollouts=1, fidelity="kinematic", workers=1, out=tmp_path / "runs")
    assert plain.folder is not None
    assert "interaction.csv" not in {path.name for path in write_csv(plain.folder)}
    assert "Robots in one world" not in (plain.folder / "report.html").read_text()
    assert "interaction" not in (plain.folder / "summary.json").read_text()


# Checks and pictures


def checked(words: Sequence[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert run_command_line(["world", "check", *words]) == 0
    return " ".join(capsys.readouterr().out.split())


def test_a_check_says_how_robots_meet_and_where_they_stand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world, path = world_of(tmp_path, SHARED), str(tmp_path / "world.yaml")
    (x, y), _ = place_berths(world)
    said = checked([path], capsys)
    assert f"interaction shared: 2 berths at the base, uv1 at ({x:.2f}, {y:.2f}), uv2 at" in said
    assert "robots that stations serve at a time, by their slots: r1 2" in said
    assert "uv1: 30 travel times" in said
    assert "uncoordinated: 2 berths" in checked([path, "--interaction", "uncoordinated"], capsys)
    alone = checked([path, "--interaction", "independent"], capsys)
    assert "slots of r1 have no effect" in alone
    assert "berth" not in alone
    assert "turtlebot2: 30 travel times" in alone


FULL = SHARED.replace("scenarios:", "".join(
    f"  x{k}: {{model: husky, incentives: {{p1: 1}}}}\n" for k in range(6)) + "scenarios:")


@pytest.mark.parametrize(("text", "key", "piece", "says"), [
    (SHARED.replace("slots: 2", "slots: 20"), "sites.stations.r1", "    r1:", "no room for 20 slots"),
    pytest.param(FULL.replace(", slots: 2", ""), "sites.base", "  base:", "no room for 8 berths",
                 marks=pytest.mark.long)])
def test_what_does_not_fit_is_an_error_of_its_line(
    text: str, key: str, piece: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(text, encoding="utf-8")
    line = text[:text.index(piece)].count("\n") + 1
    for words in (["world", "check", str(path)], ["run", str(path), "--out", str(tmp_path)],
                  ["world", "draw", str(path), "-o", str(tmp_path / "w.png")]):
        assert run_command_line(words) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert f"world.yaml:{line}: {key}: " in said
        assert says in said


@pytest.mark.long
@pytest.mark.parametrize(("text", "error"), [
    (SHARED.replace("slots: 2", "slots: 20"), sb.NoRoomForSlots), (FULL.replace(", slots: 2", ""), sb.NoRoomForBerths)])
def test_what_does_not_fit_has_an_error_of_its_own_in_python(
    text: str, error: type[sb.SvaBenchError], tmp_path: Path
) -> None:
    world = world_of(tmp_path, text)
    for function in (sb.travel_times, sb.make_instance, sb.run):
        with pytest.raises(error, match="no room for"):
            function(world)
        with pytest.raises(BadFile, match=r"world\.yaml:[0-9]+: sites\..*no room for"):
            function(tmp_path / "world.yaml")


@pytest.mark.long
def test_a_run_in_which_robots_touched_is_read_back_with_whom_they_touched(tmp_path: Path) -> None:
    # In four-rooms both robots touch soon after they left, if nobody coordinates them; physics drives such missions.
    world = Path(__file__).parents[2] / "worlds" / "four-rooms.yaml"
    assert run_command_line(["run", str(world), "--scenario", "S1", "--interaction", "uncoordinated", "--trials", "4",
                             "--rollouts", "2", "--out", str(tmp_path)]) == 0
    (folder,) = tmp_path.iterdir()
    met = pq.read_table(folder / "contacts.parquet").to_pylist()
    assert {(row["robot"], row["solid"]) for row in met} == {("uv1", "uv2"), ("uv2", "uv1")}
    assert run_command_line(["report", str(folder)]) == 0
    assert run_command_line(["replay", str(folder), "--trial", "1", "--planner", "stochastic"]) == 0


# Names that clash only where robots meet


@pytest.mark.parametrize("own", ["shared", "uncoordinated", "independent"])
def test_a_name_that_robots_would_wait_for_is_refused_only_where_they_meet(own: Interaction, tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(SMALL.replace("uv2:", "people:") + f"interaction: {own}\n")
    choices: tuple[Interaction, ...] = ("shared", "uncoordinated", "independent")
    for asked in choices:
        if asked == "independent":
            assert sb.load_world(tmp_path / "world.yaml", interaction=asked).robots[1].name == "people"
        else:
            with pytest.raises((BadFile, BadInput), match="rename the robot"):
                sb.load_world(tmp_path / "world.yaml", interaction=asked)
    (tmp_path / "world.yaml").write_text(SMALL + "interaction: nobody\n")
    with pytest.raises(BadFile, match="interaction"):
        sb.load_world(tmp_path / "world.yaml", interaction="independent")
