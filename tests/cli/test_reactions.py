"""Reactions as a user asks for them: what commands take, keep, and answer where something doesn't go together."""

from __future__ import annotations

import csv
import html
import json
import re
from pathlib import Path

import pytest

import sva_bench as sb
from sva_bench.__main__ import run_command_line
from sva_bench.analysis.reaction_table import GIVEN_COLUMNS
from sva_bench.analysis.summaries import ComparisonSummary, summary_form
from sva_bench.choices import NEWS, POLICY_NAMES
from sva_bench.files.records import as_dict, from_dict
from sva_bench.report.compared_reactions import given_answers
from tests.worlds_for_tests import SMALL, world_of

STATION = "  stations:\n    r1: {at_m: [3.2, 5.2], stop_s: 4}\n"
PLAN = '{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"]}}'
QUICK = ("--trials", "10", "--rollouts", "1", "--fidelity", "kinematic", "--workers", "1")
TAKE_LISTS = {"run": ["run", "w.yaml"], "execute": ["execute", "w.yaml", "p.json"], "batch": ["batch", "w.yaml"]}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a world, one without stations, one that reacts, and a plan."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "w.yaml").write_text(SMALL)
    (tmp_path / "bare.yaml").write_text(SMALL.replace(STATION, ""))
    (tmp_path / "reacts.yaml").write_text(SMALL + "reaction: {policy: resolve, news: instant}\n")
    (tmp_path / "p.json").write_text(PLAN)
    return tmp_path


@pytest.mark.parametrize("command", TAKE_LISTS)
@pytest.mark.parametrize(("options", "says"), [
    (("--policy", "resolv"), "--policy 'resolv': there is no such policy; did you mean 'resolve'?"),
    (("--policy", "none,resolve,none"), "--policy none: given twice"),
    (("--policy", "resolve", "--policy", "resolve"), "--policy resolve: given twice"),
    (("--policy", "resolve,"), "--policy 'resolve,': an entry is empty"),
    (("--policy", ""), "--policy: its value is empty"),
    (("--news", ""), "--news: its value is empty"),
    (("--policy", "resolve", "--news", "instant,,never"), "--news 'instant,,never': an entry is empty"),
    (("--policy", "resolve", "--news", "reprot"), "--news 'reprot': there is no such kind of news; did you mean"),
    (("--news", "instant"), "--news: no policy reacts to it; add the policy resolve"),
    (("--policy", "none", "--news", "never,report"), "--news: no policy reacts to it"),
    (("--anticipate",), "--anticipate: "),
])
def test_what_makes_no_sense_is_one_error_that_names_the_option(
    command: str, options: tuple[str, ...], says: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line([*TAKE_LISTS[command], *options]) == 2
    told = "".join(capsys.readouterr())
    assert told.startswith(f"error: {says}"), told
    assert told.count("\n") == 1
    assert not (folder / "runs").exists()


@pytest.mark.parametrize("command", TAKE_LISTS)
def test_news_at_stations_takes_a_station_whoever_asks_for_it(
    command: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [word.replace("w.yaml", "bare.yaml") for word in TAKE_LISTS[command]]
    assert run_command_line([*words, "--policy", "none,resolve", "--news", "report,station"]) == 2
    assert capsys.readouterr().err.startswith("error: --news: small has no station to hear it at; place one")
    (folder / "bare.yaml").write_text(SMALL.replace(STATION, "") + "reaction: {policy: resolve, news: station}\n")
    assert run_command_line(words) == 2
    assert "bare.yaml:33: reaction.news: there is no station to hear it at" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(("world", "options", "asks_for"), [
    ("w.yaml", (), "the policy resolve, or a reaction"), ("w.yaml", ("--policy", "none"), "the policy resolve"),
    ("reacts.yaml", ("--policy", "none"), "the policy resolve"),
    ("w.yaml", ("--policy", "resolve", "--news", "never"), "news other than never"),
])
def test_nothing_is_anticipated_where_nobody_reacts(
    world: str, options: tuple[str, ...], asks_for: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in (["run"], ["batch", "--dry-run"]):
        assert run_command_line([*command, world, "--anticipate", *options]) == 2
        said = capsys.readouterr().err
        assert said.startswith("error: --anticipate: plans for a reaction to failures, and small has none; add ")
        assert asks_for in said


def test_execute_refuses_a_plan_by_the_name_of_the_one_that_it_makes(
        folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "anticipative.json").write_text((folder / "p.json").read_text())
    assert run_command_line(["execute", "w.yaml", "anticipative.json", "--policy", "resolve", "--anticipate"]) == 2
    assert "give that another name" in capsys.readouterr().err


@pytest.mark.long
def test_a_run_keeps_what_was_asked_for_and_is_named_as_ever_where_nothing_was(folder: Path) -> None:
    def options_of(*words: str) -> tuple[str, dict[str, object]]:
        assert run_command_line([*words, *QUICK, "--out", f"out{len(list(folder.iterdir()))}"]) == 0
        (run,) = max(folder.glob("out*"), key=lambda path: int(path.name[3:])).iterdir()
        return run.name, json.loads((run / "manifest.json").read_text())["options"]

    plain, nothing = options_of("run", "w.yaml")
    assert not {"policies", "news", "anticipate"} & set(nothing)
    name, kept = options_of("run", "w.yaml", "--policy", "none,resolve", "--news", "instant,report", "--anticipate")
    assert (kept["policies"], kept["news"], kept["anticipate"]) == (["none", "resolve"], ["instant", "report"], True)
    assert name != plain
    name, kept = options_of("execute", "w.yaml", "p.json", "--policy", "resolve", "--news", "station")
    assert (kept["policies"], kept["news"]) == (["resolve"], ["station"])
    name, kept = options_of("run", "reacts.yaml", "--anticipate")  # the world's own reaction is one
    assert name != plain
    assert kept["anticipate"]


@pytest.mark.long
def test_what_comes_to_the_same_reactions_is_the_same_run(folder: Path) -> None:
    found = []
    for number, words in enumerate((["--policy", "resolve"], ["--policy", "none,resolve"],
                                    ["--policy", "resolve", "--news", "report"], ["--policy", "none"], [])):
        assert run_command_line(["run", "w.yaml", *QUICK, *words, "--out", f"out{number}"]) == 0
        (run,) = (folder / f"out{number}").iterdir()
        # Figures to the byte, of other files the names: plans say how long they took, recordings are never the same.
        figures = [run / "summary.json", *run.glob("*.parquet")]
        found.append((run.name, {str(path.relative_to(run)): path.read_bytes() if path in figures else b""
                                 for path in run.rglob("*")}))
    one, two, three, none, nothing = found
    assert one == two == three
    assert none == nothing
    assert one[0] != none[0]


def test_a_batch_takes_them_and_its_folder_keeps_them(folder: Path) -> None:
    words = ["batch", "w.yaml", *QUICK, "--cache", "cache", "--policy", "resolve", "--news", "never,report",
             "--anticipate", "--out", "b"]
    assert run_command_line(words) == 0
    kept = json.loads((folder / "b" / "manifest.json").read_text())["settings"]["options"]
    assert (kept["policies"], kept["news"], kept["anticipate"]) == (["resolve"], ["never", "report"], True)
    assert run_command_line([*words, "--resume"]) == 0


@pytest.mark.long
@pytest.mark.usefixtures("folder")
def test_a_batch_is_not_gone_on_with_under_another_reaction(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["batch", "w.yaml", *QUICK, "--cache", "cache", "--policy", "resolve", "--out", "b", "--resume"]
    assert run_command_line(words) == 0
    capsys.readouterr()
    assert run_command_line([*words, "--news", "instant"]) == 2
    assert 'options.news (absent there, ["instant"] now)' in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
def test_a_check_says_how_the_team_reacts(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["world", "check", "reacts.yaml"]) == 0
    assert "the team reacts to failures: policy resolve, news instant" in capsys.readouterr().out
    assert run_command_line(["world", "check", "w.yaml"]) == 0
    assert "reacts" not in capsys.readouterr().out


@pytest.mark.parametrize("command", TAKE_LISTS)
def test_help_lists_every_policy_and_all_news(command: str, capsys: pytest.CaptureFixture[str],
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    assert run_command_line([command, "--help"]) == 0
    shown = {line.split()[1]: line for line in capsys.readouterr().out.splitlines() if line.startswith("│ --")}
    for option, words in (("--policy", POLICY_NAMES), ("--news", NEWS)):
        assert ", ".join(words) in shown[option]
    assert "--anticipate" in shown


OTHER = '{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p4", "base"], "uv2": ["base", "p1", "base"]}}'


def test_execute_with_reactions_prints_json_writes_csv_with_ranks_and_a_page(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "both.json").write_text(OTHER)
    words = ["execute", "w.yaml", "p.json", "both.json", *QUICK, "--trials", "40", "--rollouts", "8",
             "--policy", "none,resolve", "--news", "report,instant"]
    assert run_command_line([*words, "--json", "--csv", "--out", "out"]) == 0
    told = json.loads(capsys.readouterr().out)
    (run,) = (folder / "out").iterdir()
    assert told == json.loads((run / "summary.json").read_text())
    assert told["format"] == "sva-bench/summary@2"
    with (run / "reactions.csv").open(newline="", encoding="utf-8") as file:
        header, *lines = list(csv.reader(file))
    assert header == list(GIVEN_COLUMNS)
    assert "rank" in header
    assert not {"best", "vss", "lead"} & set(header)
    rows = [dict(zip(header, line, strict=True)) for line in lines]
    expected = [
        (scenario["name"], "resolve", reaction["news"], name,
         next(ranked["rank"] for ranked in reaction["ranking"] if ranked["plan"] == name),
         plan["executed"]["mean"], reaction["value_of_recourse"][name]["mean"])
        for scenario in told["scenarios"] for reaction in scenario["reactions"]
        for name, plan in reaction["plans"].items()]
    assert len(expected) == 2 * 2 * 2  # scenarios, news, plans
    assert [(row["scenario"], row["policy"], row["news"], row["planner"], int(row["rank"]), float(row["executed"]),
             float(row["value_of_recourse"])) for row in rows] == expected
    # uv1 takes p1 for 10 by one plan, and by the other p4 for 40, whatever becomes of uv2.
    assert {(row["planner"], row["rank"]) for row in rows} == {("both", "1"), ("p", "2")}
    page = html.unescape((run / "report.html").read_text()).replace("\u00a0", " ")
    shown = page[page.index("What reacting is worth"):]
    assert "Differences with the reaction" in shown
    assert "With the reaction (policy resolve)" in shown
    assert "VSS" not in shown.split("Each plan with the reaction")[1].split("</table>")[0]
    for answer in given_answers(from_dict(ComparisonSummary, told)):
        assert all(said in page for said in (answer.condition, *answer.sentences))


@pytest.mark.spread(1)
@pytest.mark.parametrize("words", [["run"], ["execute", "p.json"], ["execute", "p.json", "both.json"]])
@pytest.mark.parametrize("anticipate", [False, True])
def test_what_a_command_wrote_is_read_reported_and_replayed(
    words: list[str], anticipate: bool, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "both.json").write_text(OTHER)
    command, *plans = words
    asked = ["--policy", "resolve", "--news", "report,instant", "--out", "out",
             *(["--anticipate"] if anticipate else [])]
    assert run_command_line([command, "w.yaml", *plans, *QUICK, *asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (run,) = (folder / "out").iterdir()
    read = from_dict(summary_form(told), told)
    assert as_dict(read) == told
    measured = ["stochastic", "deterministic"] if command == "run" else [plan.removesuffix(".json") for plan in plans]
    page = (run / "report.html").read_bytes()
    assert run_command_line(["report", str(run)]) == 0
    assert (run / "report.html").read_bytes() == page
    capsys.readouterr()
    for scenario in read.scenarios:
        for reaction in scenario.reactions or ():
            names = [*measured, *(["anticipative"] if anticipate else [])]
            assert list(reaction.plans) == names
            assert bool(reaction.candidates) == anticipate
            assert not anticipate or {tried.plan for tried in reaction.candidates} & set(measured)
            again = ["replay", str(run), "--trial", "0", "--scenario", scenario.name, "--workers", "1", "--json"]
            assert run_command_line([*again, "--policy", "resolve", "--news", reaction.news]) == 0
            rows = json.loads(capsys.readouterr().out)["rows"]
            assert list(dict.fromkeys(row["planner"] for row in rows)) == names
    assert ("chosen from" in page.decode()) == anticipate


def test_execute_prints_its_answers_and_writes_no_csv_unasked(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["execute", "w.yaml", "p.json", *QUICK, "--policy", "resolve", "--out", "out"]) == 0
    assert "If the team re-plans when a robot misses a report, in half p is worth" in " ".join(
        capsys.readouterr().out.split())
    (run,) = (folder / "out").iterdir()
    assert not list(run.glob("*.csv"))


def test_a_notebook_shows_given_plans_with_and_without_the_reaction(tmp_path: Path) -> None:
    plans = {"<i>": sb.Plan(routes={"uv1": ("base", "p1", "base")}),
             "both": sb.Plan(routes={"uv1": ("base", "p4", "base"), "uv2": ("base", "p1", "base")})}
    given = sb.execute(world_of(tmp_path), plans, policy="resolve", news=["report", "instant"], trials=10, rollouts=1,
                       fidelity="kinematic", workers=1)
    shown = given._repr_html_()
    assert shown == given.summary._repr_html_()
    heads = re.findall("<th>(.*?)</th>", shown)
    assert not any("VSS" in head for head in heads)
    rows = [dict(zip(heads, cells, strict=True)) for row in shown.split("<tr>")
            if (cells := [html.unescape(cell) for cell in re.findall("<td>(.*?)</td>", row)])]
    expected = [(name + whose, plan.executed.mean) for scenario in given.summary.scenarios for whose, measured in (
        ("", scenario.plans), *((f", {own.name}", own.plans) for own in scenario.reactions or ()))
        for name, plan in measured.items()]
    assert len(expected) == 2 * 3 * 2  # scenarios; without reaction and with each; plans
    assert [(row["plan"], float(row["executed [95 %]"].split()[0])) for row in rows] == [
        (name, round(mean, 1)) for name, mean in expected]
    assert "&lt;i&gt;, resolve on instant news" in shown


def test_a_plan_that_no_robot_could_drive_is_said_not_to_be_helped_by_allowing_it(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "twice.json").write_text(OTHER.replace('"p1"', '"p4"'))
    assert run_command_line(["execute", "w.yaml", "twice.json", "--allow-infeasible", *QUICK]) == 3
    assert "no robot could drive that, even where infeasible plans are allowed" in capsys.readouterr().err


def test_execute_prints_a_table_with_each_plan_under_each_kind_of_news(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "both.json").write_text(OTHER)
    assert run_command_line(["execute", "w.yaml", "p.json", "both.json", *QUICK, "--policy", "resolve", "--news",
                             "report,instant", "--out", "out"]) == 0
    told = capsys.readouterr().out.split("If the team re-plans (policy resolve)")[1].split("Who knows")[0]
    (run,) = (folder / "out").iterdir()
    summary = json.loads((run / "summary.json").read_text())
    rows = [re.split(r"  +", line.strip()) for line in told.splitlines() if re.search(r"\d  +\d+$", line)]
    expected = [(name, f"{plan['executed']['mean']:.1f}", str(next(
        row["rank"] for row in reaction["ranking"] if row["plan"] == name)))
        for scenario in summary["scenarios"] for reaction in scenario["reactions"]
        for name, plan in reaction["plans"].items()]
    assert [(row[-5], row[-4].split()[0], row[-2]) for row in rows] == expected
    assert [row[-6] for row in rows if len(row) > 5] == ["report", "instant"] * 2
