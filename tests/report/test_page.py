"""The page of a run: in a real browser where there is one, and from its tables again."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sva_bench.analysis.over_maps import BatchSummary, OverMaps, Percentage, UnitSummary
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import ScenarioSummary, UnitScenario
from sva_bench.analysis.summaries import Failures, Summary
from sva_bench.batch.aggregates import aggregate, map_rows
from sva_bench.errors import BadFile, BadInput
from sva_bench.report import batch_page
from sva_bench.report.batch_page import write_batch_report
from sva_bench.report.results_charts import _with_room
from sva_bench.report.results_charts import over_maps as over_maps_drawn
from sva_bench.report.vss_over_maps import headline_over_maps
from sva_bench.report.wording import (
    answer,
    assumed,
    finding,
    over_few_maps,
    percentage,
    reliability_told,
    remarks,
    vss_verdict,
    with_interval,
)
from sva_bench.storage.stored_run import write_csv
from sva_bench.study.compare import execute_plans
from sva_bench.study.costs import nominal_scenario, plan_costs
from sva_bench.study.given_plans import read_plans
from sva_bench.study.options import Options
from sva_bench.study.publish import Run, report_again
from sva_bench.study.run import run
from tests.pages import read
from tests.results_for_tests import over_maps
from tests.results_for_tests import summary as summary_of_test
from tests.worlds_for_tests import SMALL, world_of

BROWSER = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))),
               None)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("finished")
    options = Options(trials=40, rollouts=4, fidelity="kinematic")
    return run(world_of(folder), options, folder / "runs", None, lambda *_: None)


@pytest.fixture
def folder(finished: Run, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished.folder, tmp_path / "run"))


def results_of(finished: Run) -> Summary:
    assert isinstance(finished.summary, Summary)
    return finished.summary


def units_of(finished: Run, world: str = "small", seed: int = 0, variant: str = "") -> UnitSummary:
    """A finished run as if it were of a batch."""
    found = results_of(finished)
    return UnitSummary(
        world=world, seed=seed, variant=variant, trials=found.trials, rollouts=found.rollouts, fidelity=found.fidelity,
        failure=found.failure, travel=found.travel, reproducible=True, reach=found.reach,
        scenarios=tuple(UnitScenario(**{field.name: getattr(scenario, field.name) for field in fields(UnitScenario)})
                        for scenario in found.scenarios))


def batch_of(units: Sequence[UnitSummary]) -> BatchSummary:
    def different(words: Iterable[Any]) -> tuple[Any, ...]:
        return tuple(dict.fromkeys(words))

    return BatchSummary(
        trials=40, fidelity="kinematic", worlds=different(u.world for u in units), seeds=different(
            u.seed for u in units), variants=different(u.variant for u in units), units=tuple(units), failed=(),
        maps=map_rows(units, over_trials(units)), aggregate=aggregate(units))


class Page(HTMLParser):
    """Ids, references and tags of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for key, value in attrs:
            if key == "id":
                self.ids.append(value or "")
            elif key in ("href", "xlink:href", "src"):
                self.links.append(value or "")


def test_a_page_loads_nothing_and_every_reference_in_it_is_met(finished: Run) -> None:
    text = (finished.folder / "report.html").read_text()
    page = Page(text)
    assert "script" not in page.tags
    assert len(page.ids) == len(set(page.ids))
    inner = {link[1:] for link in page.links if link.startswith("#")} | set(re.findall(r"url\(#([^)]+)\)", text))
    assert inner <= set(page.ids)
    outer = [link for link in page.links if not link.startswith(("#", "data:"))]
    assert outer
    assert all((finished.folder / unquote(link)).is_file() for link in outer)
    assert any("+compare.rrd" in unquote(link) for link in outer)
    assert "@import" not in text


def test_page_terminal_and_summary_have_the_same_figures(finished: Run) -> None:
    text = read(finished.folder / "report.html")
    assert answer(finished.summary) in text
    for scenario in results_of(finished).scenarios:
        assert finding(scenario.vss) in text
        for plan in scenario.plans.values():
            assert with_interval(plan.executed) in text


_PROBE = """<script>window.onerror=m=>{document.title='error '+m};window.onload=()=>{
document.querySelectorAll('details').forEach(d=>d.open=true);
const r=[...document.querySelectorAll('svg:not(.k)')].map(s=>s.getBoundingClientRect());
document.title=JSON.stringify({wide:document.documentElement.scrollWidth,
window:innerWidth,pictures:r.length,empty:r.filter(b=>b.width<100||b.height<60).length,
answer:document.querySelector('.answer').getBoundingClientRect().bottom})}</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="no browser here")
@pytest.mark.parametrize(("width", "height"), [(1280, 900), (500, 900)])  # none narrower opens without a screen
def test_a_browser_shows_every_picture_and_the_answer_in_the_first_screenful(
        finished: Run, width: int, height: int, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    text = (finished.folder / "report.html").read_text()
    page.write_text(text.replace("<h1>", f"<h1>{'unbreakable' * 9}").replace("</body>", _PROBE))
    done = subprocess.run(
        [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", f"--window-size={width},{height}",
         f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=120)
    found = re.search(r"<title>(.*?)</title>", done.stdout)
    assert found, done.stderr
    seen: dict[str, Any] = json.loads(html.unescape(found[1]))
    assert seen["pictures"] >= 7
    assert seen["empty"] == 0
    assert seen["wide"] <= seen["window"]  # the page itself never scrolls sideways
    assert seen["answer"] <= height


def test_the_report_again_is_the_same_byte_by_byte(finished: Run, folder: Path) -> None:
    before = (folder / "report.html").read_bytes()
    (folder / "report.html").unlink()
    report_again(folder)
    assert (folder / "report.html").read_bytes() == before
    assert before == (finished.folder / "report.html").read_bytes()


def spoil(folder: Path, what: str) -> None:
    if what == "cut off":
        path = folder / "outcomes.parquet"
        path.write_bytes(path.read_bytes()[:2000])
    elif what == "nan":
        table = pq.read_table(folder / "legs.parquet")
        worse = pa.array([float("nan")] * table.num_rows)
        pq.write_table(table.set_column(table.column_names.index("driven_s"), "driven_s", worse),
                       folder / "legs.parquet")
    elif what == "foreign":
        table = pq.read_table(folder / "outcomes.parquet")
        pq.write_table(table.set_column(table.column_names.index("incentive"), "incentive",
                                        pa.array([1.0] * table.num_rows)), folder / "outcomes.parquet")
    elif what == "missing":
        (folder / "legs.parquet").unlink()
    elif what == "older":
        summary = json.loads((folder / "summary.json").read_text())
        for scenario in summary["scenarios"]:
            del scenario["vss"]["executed"]
        (folder / "summary.json").write_text(json.dumps(summary))
    else:  # a figure that contradicts another
        summary = json.loads((folder / "summary.json").read_text())
        scenario = next(s for s in summary["scenarios"] if not s["vss"]["same_plan"])
        if what == "vss":
            scenario["vss"]["executed"] = {"mean": 99.6, "ci95": [90.0, 110.0]}
        elif what == "interval":
            scenario["plans"]["stochastic"]["executed"]["ci95"] = [1e5, 1e6]
        elif what == "availability":
            scenario["availability"]["uv2"] = 0.77
        else:
            summary["seed"] += 7
        (folder / "summary.json").write_text(json.dumps(summary))


@pytest.mark.parametrize(("what", "said"), [
    ("cut off", r"outcomes\.parquet: no table of ours, or cut off"),
    ("nan", r"legs\.parquet: driven_s: holds what is no number"),
    ("foreign", r"outcomes\.parquet: incentive: these aren't the trials of summary\.json: half, stochastic"),
    ("missing", r"the run folder is incomplete: legs\.parquet is missing; run its command again"),
    ("older", r"summary\.json:\d+: scenarios\[0\]\.vss\.executed: the key 'executed' is missing; add it"),
    ("vss", r"vss\.executed\.mean: expected the difference between the plans"),
    ("interval", r"executed: ci95: the mean, .* lies outside"),
    ("availability", r"availability: not that of the world in manifest\.json"),
    ("seed", r"seed: not of the world in manifest\.json: expected 0, found 7"),
])
def test_an_invalid_run_folder_is_an_error_and_its_report_is_unchanged(folder: Path, what: str, said: str) -> None:
    spoil(folder, what)
    before = sorted((path.name, path.stat().st_size) for path in folder.iterdir())
    with pytest.raises(BadFile, match=said):
        report_again(folder)
    assert sorted((path.name, path.stat().st_size) for path in folder.iterdir()) == before


def test_what_is_no_run_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such folder"):
        report_again(tmp_path / "nothing")
    with pytest.raises(BadInput, match=r"summary\.json is missing"):
        report_again(tmp_path)


def test_tables_have_units_and_can_be_written_as_csv(folder: Path) -> None:
    schema = pq.read_schema(folder / "outcomes.parquet")
    units = {field.name: (field.metadata or {}).get(b"unit") for field in schema}
    assert units["end_time_s"] == b"s"
    assert units["fuel_used_s"] == b"s of driving"
    assert units["incentive"] == b"incentive of the world file"
    assert units["scenario"] is None
    assert [path.name for path in write_csv(folder)] == [
        "legs.csv", "outcomes.csv", "travel_times.csv", "statistics.csv"]
    lines = (folder / "outcomes.csv").read_text().splitlines()
    assert lines[0].split(",")[:5] == ['"scenario"', '"planner"', '"policy"', '"news"', '"trial"']
    assert len(lines) == 1 + 2 * 2 * 40 * 2  # scenarios, plans, trials, robots


def over_trials(units: Sequence[UnitSummary]) -> dict[tuple[str, str, str], Estimate]:
    """The executed VSS of each map, as its last seed has it."""
    return {(unit.variant, s.name, unit.world): Estimate(mean=s.vss.executed.mean, ci95=(0.0, 9.0))
            for unit in units for s in unit.scenarios}


def headline_of(*rows: OverMaps) -> str:
    return headline_over_maps(replace(batch_of([]), aggregate=rows, variants=tuple(dict.fromkeys(
        row.variant for row in rows))))


def test_a_batchs_verdict_and_figure_rest_on_the_same_interval() -> None:
    # Large maps with a surely positive VSS, and a small one that makes its percentage anybody's guess.
    assert headline_of(over_maps(5, (2.0, 8.0), (-1.0, 9.0))) == (
        "Over only 5 maps planning for failures pays in S3 (VSS 5.0 [2.0, 8.0]).")
    assert "no scenario shows a value" in headline_of(over_maps(5, (-2.0, 8.0), (1.0, 9.0)))


def test_a_batch_of_one_map_has_its_page_too(finished: Run, tmp_path: Path) -> None:
    write_batch_report(tmp_path / "report.html", batch_of([units_of(finished)]))
    text = (tmp_path / "report.html").read_text()
    assert "over 1 map<" in text
    assert "<svg" in text
    assert "From one map there is no interval over maps" in text
    assert ">variant<" not in text  # nothing was varied


def test_a_swept_batch_names_its_variants_and_each_map_is_one_point(
        finished: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: dict[str, Mapping[str, Sequence[float]]] = {}

    def watched(groups: Mapping[str, Mapping[str, Sequence[float]]], unit: str, draw: Any = over_maps_drawn) -> str:
        drawn.update(groups)
        return str(draw(groups, unit))

    monkeypatch.setattr(batch_page, "over_maps", watched)
    write_batch_report(tmp_path / "report.html", batch_of([
        units_of(finished, name, seed, variant) for variant in ("x=1", "x=2") for name in ("a", "b")
        for seed in (0, 1, 2)]))
    text = (tmp_path / "report.html").read_text()
    assert ">variant<" in text
    assert text.count(">b (x=2)<") == 1  # a map's name stands above its rows
    assert "Where all maps show the same VSS there is no interval" in text
    # Scenarios are groups, and variants are rows in them.
    assert {name: {variant: len(points) for variant, points in rows.items()} for name, rows in drawn.items()} == {
        name: {f"x={x}": 2 for x in (1, 2)} for name in ("half", "safe")}


def test_two_equal_plans_are_called_the_same_not_indistinguishable(finished: Run) -> None:
    half, safe = sorted(results_of(finished).scenarios, key=lambda s: s.name)
    assert (half.vss.same_plan, safe.vss.same_plan) == (False, True)
    assert safe.vss.verdict == vss_verdict(safe.vss) == "the same plan"
    assert "same plan" in finding(safe.vss)
    assert answer(finished.summary).endswith("In safe both plans are the same.")
    alone = replace(results_of(finished), scenarios=(safe,))
    assert answer(alone) == "Planning for failures changes nothing here: both plans are the same."
    assert remarks(alone) == []


def test_of_plans_that_are_not_proved_the_answer_says_that_nothing_is_settled(finished: Run) -> None:
    def unproved(scenario: ScenarioSummary) -> ScenarioSummary:
        late = replace(scenario.plans["deterministic"], status="time_limit")
        return replace(scenario, plans={**scenario.plans, "deterministic": late})

    half, safe = sorted(results_of(finished).scenarios, key=lambda s: s.name)
    said = answer(replace(results_of(finished), scenarios=(unproved(half), safe), reproducible=False))
    assert said.startswith("Whether planning for failures pays is not settled: some plans are not proved optimal.")
    assert "pays in" not in said
    alone = answer(replace(results_of(finished), scenarios=(unproved(safe),), reproducible=False))
    assert alone == ("Nothing can be said of planning for failures: some plans are not proved optimal, and both plans "
                     "found are the same.")


def test_given_plans_are_not_said_to_be_planned_under_anything(finished: Run, tmp_path: Path) -> None:
    said = "mission (one draw for each robot and mission: a robot that fails never leaves)"
    assert assumed(finished.summary) == f"failures planned for and executed: {said}"
    other = replace(finished.summary, failure=Failures(plan="hazard", execute="mission"))
    assert re.fullmatch(rf"failures planned for: hazard \(.*\); executed: {re.escape(said)}", assumed(other))
    plans = {path.stem: path for path in sorted((finished.folder / "plans").glob("half-*"))}
    world = world_of(tmp_path)
    given = execute_plans(world, read_plans(world, plans), Options(trials=10, rollouts=2, fidelity="kinematic"),
                          tmp_path / "runs", None, lambda *_: None, plan_costs(world, "prmstar", lambda *_: None))
    assert assumed(given.summary) == f"failures executed: {said}"
    assert "planned for" not in read(given.folder / "report.html")


def test_an_interval_from_few_noise_draws_or_few_maps_carries_a_caution(finished: Run) -> None:
    assert any("only 4 noise draws" in said for said in remarks(finished.summary))
    assert not any("noise draws" in said for said in remarks(replace(finished.summary, rollouts=16)))
    ten, nine = over_maps(10, (0.0, 2.0)), over_maps(9, (0.0, 2.0))
    assert over_few_maps([ten]) == ""
    assert "Over 9 maps only" in over_few_maps([ten, nine])
    agree = over_few_maps([over_maps(2, None)])
    assert agree.startswith("Where all maps show the same VSS there is no interval: take it for these maps only")
    both = over_few_maps([nine, over_maps(9, None)])
    assert both == f"{over_few_maps([nine])} {agree}"


def test_a_percentage_over_fewer_maps_gives_their_number() -> None:
    assert percentage(Percentage(mean=9.5, ci95=None, maps=1)) == "9.5 (1 map)"
    assert percentage(Percentage(mean=9.5, ci95=(1.0, 18.0), maps=2)) == "9.5 [1.0, 18.0] (2 maps)"
    assert percentage(Percentage(mean=None, ci95=None, maps=0)) == ""


def test_a_page_says_lifetimes_and_loss_costs_beside_the_availabilities_and_speaks_of_value(tmp_path: Path) -> None:
    text = SMALL.replace("name: small", "name: small\nfailure: hazard").replace(
        "availability: 0.75", "mtbf_s: 90\n    loss_cost: 25").replace("{uv2: 0.5}", "{uv1: 0.5, uv2: 0.8}")
    done = run(world_of(tmp_path, text), Options(trials=10, rollouts=2, fidelity="kinematic"), tmp_path / "runs", None,
               lambda *_: None)
    page = html.unescape((done.folder / "report.html").read_text(encoding="utf-8")).replace("\u00a0", " ")
    # An availability of a scenario says how long a robot lives, in the place of its lifetime.
    assert "half</b> (availability: uv1 50 %, uv2 80 %; cost of losing a robot: uv2 25): " in page
    assert not re.search(r"[Mm]ean incentive|Executed incentive|collects|Incentive by", page)
    nominal = replace(world_of(tmp_path, text), scenarios=(nominal_scenario(world_of(tmp_path, text)),))
    assert reliability_told(nominal, "nominal", done.summary) == \
        "mean driving time to failure: uv2 90 s; cost of losing a robot: uv2 25"
    mission = replace(done.summary, failure=Failures(plan="mission", execute="mission"))
    assert reliability_told(nominal, "nominal", mission) == \
        "availability: uv2 26 %; cost of losing a robot: uv2 25"  # exp(-120 s / 90 s)


@pytest.mark.parametrize(("states", "told"), [
    ([(0.6, "uv1, uv2"), (0.4, "")], "availability: uv1 and uv2 together 60 %"),
    ([(0.6, "uv1, uv2"), (0.0, "uv1"), (0.4, "")], "availability: uv1 and uv2 together 60 %"),
    ([(0.5, "uv1, uv2"), (0.5, "uv1")], "availability: uv2 50 %"),
    ([(0.5, "uv1"), (0.5, "uv2")], "availability: uv1 50 %, uv2 50 % (not independent of each other)")])
def test_robots_that_are_available_together_are_told_so(
    states: list[tuple[float, str]], told: str, tmp_path: Path
) -> None:
    joint = ", ".join(f"{{probability: {p}, available: [{names}]}}" for p, names in states)
    world = world_of(tmp_path, SMALL.replace("{uv2: 0.5}", f"{{joint: [{joint}]}}"))
    found = replace(summary_of_test((1.0, 2.0), 10.0), failure=Failures(plan="mission", execute="mission"))
    assert reliability_told(world, "half", found) == told


def test_shares_below_dots_keep_clear_of_each_other_by_their_length() -> None:
    said = {0.0: "90 %", 11.0: "5.5 %", 20.5: "5.0 %"}
    counts = [(0.0, 180), (11.0, 11), (20.5, 10)]
    assert _with_room(counts, said, 2.0) == {0.0, 11.0}
    assert _with_room(counts, said, 1.0) == {0.0, 11.0, 20.5}
