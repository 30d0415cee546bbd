"""What commands print fits 80 columns, and cuts no word, with long names and many robots."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from sva_bench.__main__ import run_command_line
from sva_bench.cli.sheets import Column, Sheet, fitted, print_sheet
from sva_bench.cli.terminal import results
from tests.worlds_for_tests import SMALL

WORLD = "world-of-thirty-letters-in-all"
ROBOTS = [f"robot-{number}-of-a-very-long-family" for number in "abcde"]
SCENARIOS = ["half-of-them-are-there-at-best", "nearly-all-of-them-are-at-home"]
SITES = {f"p{k}": f"point-of-interest-number-{k}-far" for k in range(1, 5)} | {"r1": "station-at-the-far-north-side1"}
QUICK = ["--trials", "12", "--rollouts", "2", "--fidelity", "kinematic", "--workers", "1"]
KEY = f"robots.{ROBOTS[0]}.fuel_capacity_s"
CACHE = ["--cache", "cache"]


def long_names() -> str:
    head, _ = SMALL.split("robots:\n")
    for short, name in SITES.items():
        head = head.replace(f"    {short}:", f"    {name}:")
    incentives = ", ".join(f"{SITES[f'p{k}']}: {10 * k}" for k in range(1, 5))
    robots = "".join(f"  {name}: {{model: turtlebot2, fuel_capacity_s: 60, mission_limit_s: 120, availability: 0.75, "
                     f"incentives: {{{incentives}}}}}\n" for name in ROBOTS)
    scenarios = "".join(f"  {name}: {{{ROBOTS[0]}: {p}}}\n" for name, p in zip(SCENARIOS, (0.5, 0.9), strict=True))
    return (head.replace("name: small", f"name: {WORLD}") + f"robots:\n{robots}scenarios:\n{scenarios}"
            "noise: {wheel_gain_sd: 0.05}\n")


PLAN = '{"format": "sva-bench/plan@1", "routes": {"%s": ["base", "%s", "base"]}}'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wide")
    (place / "w.yaml").write_text(long_names())
    for number in (1, 2):
        (place / f"plan-made-by-hand-{number}-long-name.json").write_text(PLAN % (ROBOTS[0], SITES[f"p{number}"]))
    return place


def printed(arguments: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
            ) -> str:
    monkeypatch.chdir(folder)
    monkeypatch.delenv("COLUMNS", raising=False)
    for needed, is_read, (command, _) in (("run", any("RUN" in word for word in arguments), COMMANDS[0]),
                                          ("batch", "batch" in arguments[1:3], COMMANDS[3])):
        if is_read and not (folder / needed).exists():  # the case that makes it may not have been chosen
            assert run_command_line(command) == 0
    run = next((folder / "run").glob("*"), folder)
    capsys.readouterr()
    assert run_command_line([word.replace("RUN", str(run)) for word in arguments]) == 0
    return capsys.readouterr().out


BATCH = ["batch", "w.yaml", *QUICK, "--set", f"{KEY}=20,60", *CACHE]
COMMANDS = [
    (["run", "w.yaml", *QUICK, "--out", "run", "--policy", "resolve", "--news", "report,instant", "--assumptions",
      "--verbose"], [WORLD, *SCENARIOS, *ROBOTS, "stochastic", "deterministic", "interplay"]),
    (["execute", "w.yaml", "plan-made-by-hand-1-long-name.json", "plan-made-by-hand-2-long-name.json", *QUICK, "--out",
      "executed", "--policy", "resolve"],
     [WORLD, *SCENARIOS, *ROBOTS, "plan-made-by-hand-1-long-name", "plan-made-by-hand-2-long-name"]),
    ([*BATCH, "--dry-run"], [WORLD, f"{KEY}=20", f"{KEY}=60"]),
    ([*BATCH, "--out", "batch", "--compare", KEY, "--policy", "resolve"],
     [WORLD, *SCENARIOS, f"{KEY}=20", f"{KEY}=60", KEY, "stochastic", "deterministic"]),
    (["batch", "status", "batch"], [*SCENARIOS, f"{KEY}=20", f"{KEY}=60"]),
    (["report", "batch", "--compare", f"{KEY}=20"], [*SCENARIOS, KEY]),
    (["verify", "RUN", "--workers", "1"], ["ok"]),
    (["expect", "RUN", f"{SCENARIOS[0]}.plans.stochastic.executed.mean >= "
      f"{SCENARIOS[0]}.plans.deterministic.executed.ci95[0]"],
     ["ok", f"{SCENARIOS[0]}.plans.stochastic.executed.mean"]),
    (["replay", "RUN", "--scenario", SCENARIOS[0], "--trial", "worst", "--policy", "resolve", "--news", "report",
      "--workers", "1"], [SCENARIOS[0], *ROBOTS]),
    (["certify", "RUN/instance-" + SCENARIOS[0] + ".json", "plan-made-by-hand-1-long-name.json"], ["feasible,"]),
    (["doctor"], ["planner", "physics"]),
    (["world", "example", "--list"], ["four-rooms"]),
    (["world", "check", "w.yaml"], [WORLD]),
    (["world", "check", "w.yaml", "--noise", "--draws", "5"], [*SCENARIOS, ROBOTS[0], SITES["p1"], "base"]),
]


@pytest.mark.spread(3)
@pytest.mark.parametrize(("arguments", "names"), COMMANDS, ids=[" ".join(words[:2]) for words, _ in COMMANDS])
def test_every_line_fits_eighty_columns_and_no_name_is_cut(
    arguments: list[str], names: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = printed(arguments, folder, monkeypatch, capsys)
    assert [line for line in said.splitlines() if cell_len(line) > 80] == []
    assert "…" not in said
    shown = set(said.replace(",", " ").replace(":", " ").split())
    assert [name for name in names if name not in shown and name not in said] == []


def test_wide_shows_all_columns_whatever_the_width(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = printed(["run", "w.yaml", *QUICK, "--out", "run", "--wide"], folder, monkeypatch, capsys)
    (head,) = (line for line in said.splitlines() if line.startswith("scenario "))
    for heading in ("plan", "promised", "expected", "executed [95 %]", *ROBOTS, "VSS executed [95 %]", "VSS modelled",
                    "EVPI"):
        assert f" {heading}" in head
    assert "Left out" not in said


def test_columns_is_honoured_in_a_pipe(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    for told, most in (("120", 120), ("0", 80), ("wide", 80), ("", 80)):
        monkeypatch.setenv("COLUMNS", told)
        assert run_command_line([*BATCH, "--dry-run"]) == 0
        longest = max(map(cell_len, capsys.readouterr().out.splitlines()))
        assert 60 < longest <= most


def test_intervals_are_stacked_before_anything_is_left_out() -> None:
    sheet = Sheet(title="", columns=[Column(heading="scenario", words=True, above=True), Column(heading="a [95 %]"),
                                     Column(heading="b [95 %]"), Column(heading="c", last=1)],
                  rows=[["S1", "15.7 [11.8, 19.8]", "the same plan", "4.0"]])
    wide, _ = fitted(sheet, 80)
    assert [line for line, _ in wide][-1] == "S1        15.7 [11.8, 19.8]  the same plan  4.0"
    narrow, left_out = fitted(sheet, 45)
    assert left_out == []
    assert any(line.rstrip().endswith("[11.8, 19.8]") for line, _ in narrow)
    least, left_out = fitted(sheet, 31)
    assert left_out == ["c"]
    assert all(cell_len(line) <= 31 for line, _ in least)


names = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1, max_size=30)
figures = st.builds("{:.1f} [{:.1f}, {:.1f}]".format, *[st.floats(-9999, 9999)] * 3)


@given(st.lists(st.tuples(names, names, figures, figures, figures), min_size=1, max_size=5),
       st.lists(names, min_size=5, max_size=5))
def test_any_names_and_figures_fit_and_none_is_lost(
    rows: list[tuple[str, str, str, str, str]], headings: list[str]
) -> None:
    sheet = Sheet(title="", rows=rows, columns=[
        Column(heading=heading, words=k < 2, above=k < 2, last=max(k - 2, 0))
        for k, heading in enumerate(headings)])
    lines, left_out = fitted(sheet, 80)
    shown = " ".join(line for line, _ in lines).split()
    assert all(cell_len(line) <= 80 for line, _ in lines)
    for first, second, figure, *_ in rows:
        for word in (first, second, *figure.split()):
            assert word in {each.rstrip(",") for each in shown} | set(shown)
    assert not set(left_out) & {headings[2]} or headings.count(headings[2]) > 1


def test_a_figure_rounded_to_nought_from_below_has_no_sign_and_names_keep_theirs(
    capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [["robot-0.0", "-0.0"], ["a-0", "-0.0 [-0.0, 1.0]"], ["b", "-0"], ["c", "-0.5"],
            ["d", "-0.05 [-10.0, -0.0]"]]
    columns = [Column(heading="name", words=True), Column(heading="x")]
    print_sheet(Sheet(title="", rows=rows, columns=columns), results())
    shown = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[2:] if line.strip()]
    assert shown == [["robot-0.0", "0.0"], ["a-0", "0.0 [0.0, 1.0]"], ["b", "0"], ["c", "-0.5"],
                     ["d", "-0.05 [-10.0, 0.0]"]]
