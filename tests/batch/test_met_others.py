"""What robots did to each other in batches: sums of ranges are those of the whole, and shards keep them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sva_bench.__main__ import run_command_line
from sva_bench.analysis.meetings import MetTally, interaction_summary, met_tally
from sva_bench.batch.grid import Point
from sva_bench.batch.jobs import TravelTimesJob
from sva_bench.batch.schema import StoredMet, StoredNote
from sva_bench.batch.shards import Unit, read_note, shard_of
from sva_bench.batch.strands import facts_at
from sva_bench.batch.tallies import join, scenario_of
from sva_bench.execution.meetings import Meetings
from sva_bench.files.records import as_dict, from_dict
from sva_bench.robot.model import BUILT_IN
from sva_bench.storage.tables import read_note_of
from sva_bench.study.options import Options, settings_of
from sva_bench.study.run import measure
from sva_bench.world.model import World
from sva_bench.world.noise import LocalisationError
from tests.batch.test_commands import rows_of
from tests.worlds_for_tests import SMALL, world_of

EIGHT = Meetings(contacts=np.array([0, 1, 0, 0, 0, 2, 0, 0]), waited_s=np.array([0, 3.5, 1, 2, 0, 0, 9, 0.5]),
                 detours=np.array([1, 0, 0, 0, 2, 0, 0, 0]), exact=np.array([1, 1, 0, 1, 1, 1, 1, 1], dtype=bool))


@given(st.integers(1, 7))
def test_sums_of_two_ranges_are_those_of_the_whole(cut: int) -> None:
    first, second = met_tally(EIGHT.rows(slice(0, cut))), met_tally(EIGHT.rows(slice(cut, 8)))
    assert first is not None
    assert second is not None
    kept = MetTally(**vars(from_dict(StoredMet, json.loads(json.dumps(as_dict(StoredMet(**vars(first))))))))
    # By hand: 3 contacts, 16 s, 3 detours, 7 exact of 8.
    assert kept + second == MetTally(missions=8, contacts=3, waited_s=16.0, detours=3, exact=7)
    assert (kept + second).means == interaction_summary(EIGHT)


@pytest.fixture(scope="module")
def shard(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Unit]:
    """A shard of trials of robots that meet, and its unit."""
    folder = tmp_path_factory.mktemp("shard")
    world, options = world_of(folder, SMALL + "interaction: shared\n"), Options(
        trials=8, rollouts=2, fidelity="kinematic")
    done = measure(world, options, None, lambda *_: None)
    executed = [replace(run, meetings=EIGHT) for run in done.executed]
    found = shard_of(world, "", executed, settings_of(world, options),
                     facts_at(world, options, done.costs, done.planned), {})
    path = folder / "outcomes-small-seed0.parquet"
    path.write_bytes(found.content)
    return path, Unit(point=Point(world=world, planner="prmstar", variant=""), seed=0, first=0, trials=8, rollouts=2,
                      reactions=())


def test_a_shard_keeps_them_and_the_results_of_its_unit_say_them(shard: tuple[Path, Unit]) -> None:
    note = read_note(*shard)
    for facts in note.facts.scenarios:
        whole = join(note.tallies[facts.name], note.tallies[facts.name])  # twice the same missions, the same means
        for tally in (note.tallies[facts.name], whole):
            found = scenario_of(facts, tally, note.robots, None, None)
            assert [plan.interaction for plan in found.plans.values()] == [interaction_summary(EIGHT)] * 2


@pytest.mark.parametrize("change", [{"missions": 7}, {"exact": 9}, {"waited_s": -1.0}, {"contacts": 0.5}, None])
def test_sums_that_are_not_of_the_shards_trials_are_refused(change: dict[str, Any] | None, shard: tuple[Path, Unit]
                                                            ) -> None:
    told = json.loads(read_note_of(shard[0], b"sva-bench/unit"))
    from_dict(StoredNote, told)
    plan = told["tallies"]["half"]["plans"]["stochastic"]
    plan["met"] = None if change is None else plan["met"] | change
    with pytest.raises(ValidationError, match=r"met|did to each other"):
        from_dict(StoredNote, told)


# Berths


TIGHT = """\
format: sva-bench/world@1
name: tight
map: {shapes: {bounds_m: [0, 0, 8, 1.3]}}
sites: {base: {at_m: [1, 0.5]}, pois: {p1: {at_m: [4, 0.6]}}}
robots:
  uv1: {model: turtlebot2, incentives: {p1: 1}}
  uv2: {model: turtlebot2, incentives: {p1: 1}}
"""


@pytest.mark.long
def test_a_world_without_room_for_berths_is_given_up_and_the_others_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in (("tight", TIGHT), ("small", SMALL)):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    words = ["batch", *(str(tmp_path / f"{name}.yaml") for name in ("tight", "small")), "--interaction", "shared",
             "--trials", "2", "--rollouts", "1", "--fidelity", "kinematic", "--workers", "1", "--out",
             str(tmp_path / "done"), "--cache", str(tmp_path / "cache")]
    assert run_command_line(words) == 4
    (failure,) = json.loads((tmp_path / "done" / "failures.json").read_text())["failures"]
    assert failure["world"] == "tight"
    assert "no room for 2 berths" in failure["reason"]
    assert [path.name for path in (tmp_path / "done").glob("outcomes-*")] == ["outcomes-small-seed0.parquet"]
    capsys.readouterr()


def job_of(world: World, number: int) -> TravelTimesJob:
    robot = world.robots[number]
    return TravelTimesJob(world=world, model=robot.model, planner="prmstar",
                          robot=robot.name if world.meets else None)


def test_travel_times_are_shared_by_what_berths_depend_on_and_nothing_else(tmp_path: Path) -> None:
    world = world_of(tmp_path, SMALL + "interaction: shared\n")
    key = job_of(world, 0).key
    poorer = replace(world, robots=tuple(replace(robot, incentives={}, fuel_capacity_s=9.0) for robot in world.robots))
    assert job_of(poorer, 0).key == key
    assert job_of(replace(world, interaction="uncoordinated"), 0).key == key
    station = replace(world.sites[1], slots=2)
    larger = replace(world.robots[1], model=BUILT_IN["jackal"])
    unsure = replace(world.noise, localisation=LocalisationError(sd_m=0.05, sd_deg=1.0, length_m=3.0))
    others = [job_of(world, 1), job_of(replace(world, interaction="independent"), 0),
              job_of(replace(world, sites=(world.sites[0], station, *world.sites[2:])), 0),
              job_of(replace(world, robots=(world.robots[0], larger)), 0), job_of(replace(world, noise=unsure), 0)]
    assert len({key, *(job.key for job in others)}) == 1 + len(others)


# Rows


@pytest.mark.long
def test_rows_of_robots_that_meet_are_the_same_on_any_number_of_workers_and_after_a_crash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = tmp_path / "small.yaml"
    world.write_text(SMALL.replace("noise: {wheel_gain_sd: 0.01}", "noise: realistic\nfailure: per_leg\n"
                                   "interaction: shared"), encoding="utf-8")
    words = ["batch", str(world), "--seed", "0-1", "--trials", "40", "--unit-trials", "20", "--rollouts", "4",
             "--fidelity", "kinematic", "--json", "--cache", str(tmp_path / "cache")]

    def told(out: str, *more: str) -> str:
        assert run_command_line([*words, "--out", str(tmp_path / out), *more]) == 0
        return capsys.readouterr().out

    one, two = (told(f"on-{workers}", "--workers", workers) for workers in ("1", "2"))
    assert one == two
    rows = rows_of(tmp_path / "on-1")
    assert rows.equals(rows_of(tmp_path / "on-2"))
    assert len(set(rows["end"].to_pylist())) > 1
    sorted((tmp_path / "on-2").glob("outcomes-*.parquet"))[-1].unlink()
    (tmp_path / "on-2" / "summary.json").unlink()
    assert told("on-2", "--workers", "2", "--resume") == one
    assert rows.equals(rows_of(tmp_path / "on-2"))
