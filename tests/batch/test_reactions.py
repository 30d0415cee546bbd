"""Reactions in batches: figures of a run, in any order of work, aggregated over maps."""

from __future__ import annotations

import csv
import html
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sva_bench as sb
from sva_bench.__main__ import run_command_line
from sva_bench.analysis.over_maps import BatchSummary, GainOverMaps, Percentage, ReactionOverMaps, UnitSummary
from sva_bench.analysis.reaction_results import Gain, ReactionResult
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import UnitScenario
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.reactions import ReactionsJob
from sva_bench.batch.reactions_over_maps import reactions_over_maps
from sva_bench.batch.shards import Unit, read_note
from sva_bench.batch.strands import strand
from sva_bench.choices import NEWS, News
from sva_bench.errors import BadFile
from sva_bench.execution import plays, react
from sva_bench.files.codec import decoded, encoded
from sva_bench.files.records import as_dict, from_dict
from sva_bench.report.batch_page import write_batch_report
from sva_bench.report.reactions_over_maps import answers_over_maps, reaction_table
from sva_bench.study.options import Options
from tests.pages import untypeset
from tests.results_for_tests import unit
from tests.worlds_for_tests import SMALL, world_of

QUICK = ("--trials", "30", "--rollouts", "3", "--fidelity", "kinematic", "--unit-trials", "10")
REACT = ("--policy", "none,resolve", "--news", "report,instant", "--anticipate")


def batch(folder: Path, *words: str) -> None:
    """A batch of the two worlds of a folder."""
    assert run_command_line(["batch", str(folder / "one.yaml"), str(folder / "two.yaml"), *QUICK, "--cache",
                             str(folder / "cache"), *words]) == 0


def content_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two worlds, and a batch of both with reactions in ``done``."""
    place = tmp_path_factory.mktemp("batch")
    (place / "one.yaml").write_text(SMALL.replace("name: small", "name: one"), encoding="utf-8")
    (place / "two.yaml").write_text(SMALL.replace("name: small", "name: two").replace("p4: 40", "p4: 35"),
                                    encoding="utf-8")
    batch(place, *REACT, "--out", str(place / "done"), "--workers", "2", "--csv")
    return place


def units_of(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((folder / "summary.json").read_text())["units"]
    return found


def test_a_unit_has_the_reactions_of_a_run(folder: Path) -> None:
    whole = sb.run(folder / "one.yaml", trials=30, rollouts=3, fidelity="kinematic", workers=1, anticipate=True,
                   policy="resolve", news=["report", "instant"])
    (mine,) = (unit for unit in units_of(folder / "done") if unit["world"] == "one")
    for scenario, own in zip(whole.summary.scenarios, mine["scenarios"], strict=True):
        assert scenario.reactions is not None
        assert json.loads(json.dumps([as_dict(reaction) for reaction in scenario.reactions])) == own["reactions"]


@pytest.mark.long
def test_any_number_of_workers_and_any_interruption_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    done = content_of(folder / "done")
    batch(folder, *REACT, "--out", str(tmp_path / "again"), "--workers", "1", "--csv", "--cache", str(tmp_path))
    assert content_of(tmp_path / "again") == done
    # The first unit of a map has its reactions in it, the second hasn't: each is lost once.
    for lost in ("one-seed0-t00000000", "two-seed0-t00000010"):
        (tmp_path / "again" / f"outcomes-{lost}.parquet").unlink()
    batch(folder, *REACT, "--out", str(tmp_path / "again"), "--resume", "--csv")
    assert content_of(tmp_path / "again") == done


def test_a_batch_with_other_reactions_isnt_gone_on_with(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(folder / "done", tmp_path / "done")
    words = ["batch", str(folder / "one.yaml"), str(folder / "two.yaml"), *QUICK, "--cache", str(folder / "cache")]
    assert run_command_line([*words, "--policy", "resolve", "--news", "report", "--out", str(tmp_path / "done"),
                             "--resume"]) == 2
    assert "options.news" in capsys.readouterr().err


@pytest.mark.parametrize(("first", "reactions"), [
    (0, ()), (0, (("resolve", "report"),)), (10, (("resolve", "report"),))])
def test_the_shard_of_a_unit_with_other_reactions_is_refused(
    folder: Path, first: int, reactions: tuple[Any, ...]
) -> None:
    world = sb.load_world(folder / "one.yaml")
    path = folder / "done" / f"outcomes-one-seed0-t{first:08d}.parquet"
    sought = Unit(point=Point(world=world, planner="prmstar"), seed=0, first=first, trials=10, rollouts=3,
                  reactions=reactions)
    with pytest.raises(BadFile, match="reactions: the shard of another unit"):
        read_note(path, sought)


def test_the_tables_of_reactions_have_a_row_for_each_figure(folder: Path) -> None:
    with (folder / "done" / "reactions.csv").open() as file:
        rows = list(csv.DictReader(file))
    figures = {("vss", ""), ("vss_with_recourse", ""), ("anticipation", ""), *(
        ("value_of_recourse", plan) for plan in ("stochastic", "deterministic", "anticipative"))}
    assert {(row["figure"], row["plan"]) for row in rows} == figures
    assert len(rows) == 2 * 2 * len(figures)  # scenarios, news
    with (folder / "done" / "reactions-maps.csv").open() as file:
        each = list(csv.DictReader(file))
    assert len(each) == 2 * len(rows)
    for row in rows:
        mine = [float(own["mean"]) for own in each if all(own[key] == row[key] for key in (
            "scenario", "policy", "news", "figure", "plan"))]
        assert float(row["mean"]) == pytest.approx(np.mean(mine))


def test_the_page_of_a_batch_shows_its_reactions_and_begins_with_what_vss_is_under_each(folder: Path) -> None:
    page = untypeset(html.unescape((folder / "done" / "report.html").read_text()))
    assert "Teams that react" in page
    assert "Who knows what when: " in page
    table = page[page.index("Teams that react"):].split("</table>")[0]
    assert "<th scope=\"col\">VSS [%]</th>" in table
    assert not re.search(r"<td[^>]*>[^<]*%", table)  # incentive and per cent in columns of their own
    first = page[:page.index("<table")]
    assert "If the team keeps its plan, on both maps the VSS is the same" in first
    summary = from_dict(BatchSummary, json.loads((folder / "done" / "summary.json").read_text()))
    answers = answers_over_maps(summary.reactions)
    assert answers
    for answer in answers:
        assert f"<b>{answer.condition}</b> {answer.sentences[0]}" in first


def test_that_one_map_tells_nothing_over_maps_is_said_of_any_team(folder: Path, tmp_path: Path) -> None:
    summary = from_dict(BatchSummary, json.loads((folder / "done" / "summary.json").read_text()))
    one = replace(summary, aggregate=tuple(replace(row, maps=1) for row in summary.aggregate))
    write_batch_report(tmp_path / "report.html", one)
    page = html.unescape((tmp_path / "report.html").read_text())
    assert "<p>One map can't tell" in page
    assert "keeps its plan" not in page


def over_maps(news: News, scenario: str, mean: float, ends: tuple[float, float] | None) -> ReactionOverMaps:
    found = GainOverMaps(mean=mean, ci95=ends, pct=Percentage(mean=None, ci95=None))
    return ReactionOverMaps(
        variant="slow" if scenario == "varied" else "", scenario=scenario, policy="resolve", news=news, maps=3,
        vss=found, value_of_recourse={}, vss_with_recourse=found, anticipation=found)


def test_what_vss_is_over_maps_under_a_reaction_is_told_by_its_interval_in_a_sentence() -> None:
    rows = [over_maps("report", "pays", 5.0, (2.0, 8.0)), over_maps("report", "varied", 6.0, (3.0, 9.0)),
            over_maps("report", "loses", -4.0, (-6.0, -2.0)), over_maps("report", "even", 1.0, (-1.0, 3.0)),
            over_maps("report", "zero", 0.0, (0.0, 0.0)), over_maps("report", "one", -2.0, None)]
    (said,) = answers_over_maps(rows)
    assert str(said) == (
        "If the team re-plans when a robot misses a report, planning for failures is worth 5.0 [2.0, 8.0] in pays and "
        "6.0 [3.0, 9.0] in varied (slow); the deterministic plan is worth more in loses (VSS -4.0 [-6.0, -2.0]); the "
        "value of planning for failures is not distinguishable from zero in even; both plans are worth exactly the "
        "same in zero; VSS, which has no interval over maps, is -2.0 in one.")


def test_over_maps_news_that_come_to_the_same_share_a_sentence_and_no_news_has_its_own() -> None:
    rows = [over_maps(news, "S", 5.0, (2.0, 8.0)) for news in NEWS]
    assert [answer.condition for answer in answers_over_maps(rows)] == [
        "If the team re-plans on news of failures but never has any,",
        "If the team re-plans at the stations where robots hear of a failure, or when a robot misses a report, or the "
        "moment a robot fails,"]
    assert answers_over_maps([]) == []


def test_how_far_a_batch_is_says_what_reacting_is_worth_so_far(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line(["batch", "status", str(folder / "done"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["reactions"] == json.loads((folder / "done" / "summary.json").read_text())["reactions"]
    assert run_command_line(["batch", "status", str(folder / "done")]) == 0
    assert "Reactions over maps" in capsys.readouterr().out


@pytest.mark.long
def test_a_batch_that_is_taken_up_again_reacts_as_before(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "done", tmp_path / "done")
    (tmp_path / "done" / "outcomes-one-seed0-t00000000.parquet").unlink()
    assert run_command_line(["batch", "retry", str(tmp_path / "done"), "--cache", str(folder / "cache"), "--csv"]) == 0
    assert content_of(tmp_path / "done") == content_of(folder / "done")


@pytest.mark.long
def test_how_a_world_reacts_is_varied_as_any_key(folder: Path, tmp_path: Path) -> None:
    words = ["batch", str(folder / "one.yaml"), *QUICK, "--cache", str(folder / "cache"), "--scenario", "half",
             "--out", str(tmp_path / "out")]
    assert run_command_line([*words, "--set", "reaction.policy=none,resolve"]) == 0
    still, reacts = units_of(tmp_path / "out")
    assert "reactions" not in still["scenarios"][0]
    assert [row["news"] for row in reacts["scenarios"][0]["reactions"]] == ["report"]
    del reacts["scenarios"][0]["reactions"]
    assert reacts["scenarios"] == still["scenarios"]


@pytest.mark.long
def test_a_sweep_file_names_reactions_as_options_do(folder: Path, tmp_path: Path) -> None:
    sweep = tmp_path / "sweep.yaml"
    sweep.write_text(f"format: sva-bench/sweep@1\nworlds: [{folder}/one.yaml, {folder}/two.yaml]\ntrials: 30\n"
                     "rollouts: 3\nfidelity: kinematic\nunit_trials: 10\npolicy: [none, resolve]\n"
                     "news: report,instant\nanticipate: true\n", encoding="utf-8")
    assert run_command_line(["batch", str(sweep), "--cache", str(folder / "cache"), "--out", str(tmp_path / "out"),
                             "--csv"]) == 0
    assert content_of(tmp_path / "out") == content_of(folder / "done")


def gain(mean: float, pct: float | None) -> Gain:
    return Gain(mean=mean, ci95=None, pct=pct)


def reacting(world: str, seed: int, mean: float, pct: float | None, example: ReactionResult) -> UnitSummary:
    """A map and seed at which every gain of the reaction is this."""
    bare = unit(world, mean)
    result = replace(
        example, value_of_recourse={"stochastic": gain(mean, pct)}, vss_with_recourse=gain(mean, pct),
        anticipation=gain(mean, pct),
        vss=replace(example.vss, executed=Estimate(mean=mean, ci95=None), executed_pct=pct))
    scenario: UnitScenario = replace(bare.scenarios[0], reactions=(result,))
    return replace(bare, seed=seed, scenarios=(scenario,))


def test_over_maps_the_maps_are_the_sample_and_seeds_are_nested_in_them(tmp_path: Path) -> None:
    found = sb.run(world_of(tmp_path), trials=4, rollouts=2, fidelity="kinematic", policy="resolve", workers=1)
    example = found.summary.scenarios[0].reactions
    assert example is not None
    # Map a: seeds of 2 and 4, the one at 10 %, the other without a percentage; map b: 7 at 30 %.
    rows = reactions_over_maps([reacting("a", 0, 2, 10, example[0]), reacting("a", 1, 4, None, example[0]),
                                reacting("b", 0, 7, 30, example[0]), unit("c", 1.0)])
    (row,) = rows
    assert (row.maps, row.policy, row.news) == (2, "resolve", "report")
    for gained in (row.vss, row.value_of_recourse["stochastic"], row.vss_with_recourse, row.anticipation):
        assert gained.mean == pytest.approx(5)  # of 3 and 7
        assert gained.pct.mean == pytest.approx(20)
        assert gained.ci95 is not None
        assert gained.ci95[0] < 3 < 7 < gained.ci95[1]


@pytest.mark.parametrize("narrow", [True, False])
def test_no_figure_of_the_best_plan_is_in_per_cent_of_another_base_than_the_vss_beside_it(narrow: bool) -> None:
    def told(pct: float) -> GainOverMaps:
        return GainOverMaps(mean=pct / 10, ci95=None, pct=Percentage(mean=pct, ci95=None))

    head, _, (cells,) = reaction_table([ReactionOverMaps(
        variant="", scenario="S", policy="resolve", news="report", maps=2, vss=told(11.0),
        value_of_recourse={"stochastic": told(22.0)}, vss_with_recourse=told(33.0), anticipation=told(44.0))],
        narrow=narrow)
    assert {"VSS with recourse", "anticipation"} <= set(head)
    shown = " ".join(cells).split()
    assert {"1.1", "11.0", "2.2", "22.0", "3.3", "4.4"} <= set(shown)
    assert not {"33.0", "44.0"} & set(shown)


def test_a_job_is_known_by_what_its_result_depends_on(tmp_path: Path) -> None:
    world = world_of(tmp_path)

    def job(options: Options, name: str = "small") -> ReactionsJob:
        point = Point(world=replace(world, name=name), planner="prmstar")
        steps = strand(Grid(points=[point], seeds=[0], options=options, unit_trials=10), point, 0, frozenset())
        jobs = next(steps)
        while not isinstance(jobs[0], ReactionsJob):
            jobs = steps.send([each.run() for each in jobs])
        return jobs[0]

    options = Options(trials=4, rollouts=2, fidelity="kinematic", policies=("resolve",), news=("report",))
    first = job(options)
    assert first.key == job(replace(options, policies=("none", "resolve"))).key
    others = [replace(options, trials=3), replace(options, rollouts=1), replace(options, news=("instant",)),
              replace(options, anticipate=True)]
    assert len({first.key, *(job(other).key for other in others)}) == 1 + len(others)
    result = first.run()
    assert first.fits(result)
    assert decoded(encoded(result, ReactionsJob.result), ReactionsJob.result) == result
    assert not first.fits(dict.fromkeys(result, ()))


def test_a_batch_with_more_trials_than_memory_holds_ends_at_the_first_world_with_one_message(
        folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(plays, "MOST_HISTORIES", 0)
    monkeypatch.setattr(react, "MOST_TRIALS_HELD", 100)
    assert run_command_line(["batch", str(folder / "one.yaml"), str(folder / "two.yaml"), *QUICK, *REACT, "--workers",
                             "1", "--cache", str(folder / "cache"), "--out", str(tmp_path / "out")]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert told.count("the histories of") == 1
    assert "30 trials of 10 plans with and without reaction: the histories of one are too many" in told
    assert "at most 5 trials can be sampled (--trials)" in told
    assert not list((tmp_path / "out").glob("*.parquet"))
    assert not (tmp_path / "out" / "failures.json").exists()
