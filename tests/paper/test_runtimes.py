"""The benchmark of the paper's table: rows are solved once, and tables and picture say what the rows say."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.choices import Method, Status
from sva_bench.errors import BadFile, BadInput
from sva_bench.paper.gaps_picture import draw_gaps
from sva_bench.paper.printed import FIGURE_3, TABLE_2, TABLE_3, Box
from sva_bench.paper.runtimes import (
    QUICK,
    checks,
    cuts_table,
    gaps_table,
    markdown,
    methods_table,
    reproduce,
    runtime_table,
    write_report,
)
from sva_bench.paper.solves import METHODS, Row, Study, read_rows, run
from sva_bench.solver.two_stage import plan_stochastic

PAPER = Path(__file__).parents[2] / "../shared/paper.tex"
DOCS = Path(__file__).parents[2] / "docs"
# A mission limit of 0.6 fuel capacities leaves POIs behind, so that there is something to prove and to cut.
TINY = Study(pois=(6,), seeds=(1,), fuel_multiples=(2.25,), availabilities=(0.75,), tau=0.6)


def row(pois: int, method: Method, *, value: float = 100.0, bound: float = 100.0, process_s: float = 1.0,
        optimality: int = 0, subtour: int = 0, fuel: float = 2.25, status: Status | None = None) -> Row:
    return Row(pois=pois, seed=0, fuel_multiple=fuel, availability=0.75, method=method, tau=1.0, time_limit_s=10.0,
               status=status or ("optimal" if bound == value else "time_limit"), value=value, bound=bound,
               process_s=process_s, wall_s=process_s, optimality_cuts=optimality, subtour_cuts=subtour, nodes=0,
               proved_by=method, processor="abacus")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    reproduce(TINY, folder)
    return folder


def cells(table: str, *first: str) -> list[str]:
    """The cells of the table's line that begins with these."""
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return next(line for line in lines if line[:len(first)] == list(first))


def test_each_method_has_a_row_and_all_prove_the_same_value(folder: Path) -> None:
    rows = read_rows(folder / "paper-runtimes.csv")
    assert [one.method for one in rows] == list(METHODS)
    assert {one.status for one in rows} == {"optimal"}
    assert max(one.value for one in rows) == pytest.approx(min(one.value for one in rows), rel=2e-6)


def test_cuts_in_the_table_are_those_that_the_solver_counts(folder: Path) -> None:
    rows = read_rows(folder / "paper-runtimes.csv")
    table = methods_table(rows, "POIs", lambda one: one.pois)
    for one in rows:
        details = plan_stochastic(one.case.instance(TINY.tau), method=one.method).details
        optimality, subtour = cells(table, "6", f"`{one.method}`")[-2:]
        assert subtour == str(details["cuts"])
        assert optimality == (f"{details['optimality_cuts']:.1f}" if one.method == "lshaped" else "")


def test_a_second_start_solves_nothing_again(folder: Path) -> None:
    path = folder / "paper-runtimes.csv"
    before, solved = path.read_bytes(), []
    rows = run(TINY, path, lambda done, of, one: solved.append((done, of, one.method)))
    assert not solved
    assert len(rows) == len(METHODS)
    assert path.read_bytes() == before


def test_a_run_that_was_killed_within_a_line_solves_what_is_missing(folder: Path, tmp_path: Path) -> None:
    lines = (folder / "paper-runtimes.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    path, solved = tmp_path / "rows.csv", []
    path.write_text("".join(lines[:-1]) + lines[-1][:9], encoding="utf-8")
    rows = run(TINY, path, lambda done, of, one: solved.append((done, of, one.method)))
    assert solved == [(5, 5, "auto")]
    assert read_rows(path) == rows


def test_rows_of_another_limit_are_not_mixed_in(folder: Path) -> None:
    with pytest.raises(BadInput, match=r"made with a time limit of 60 s .* pass --time-limit 60 --tau 0.6"):
        run(replace(TINY, time_limit_s=1.0), folder / "paper-runtimes.csv")


def test_what_is_no_file_of_rows_is_refused_with_its_place(folder: Path, tmp_path: Path) -> None:
    text = (folder / "paper-runtimes.csv").read_text(encoding="utf-8")
    path = tmp_path / "rows.csv"
    for wrong, complaint in (
            ("a,b\n1,2\n", r"rows.csv:1: these are not the columns"),
            (text.replace(",dep,", ",deep,", 1), r"rows.csv:2: method: 'deep' is no such value"),
            (text.replace("\n6,1,2.25,", "\n6,1,nan,", 1), r"rows.csv:2: fuel_multiple: 'nan' is no such value"),
            (text + "1,2\n", r"rows.csv:7: 2 cells")):
        path.write_text(wrong, encoding="utf-8")
        with pytest.raises(BadFile, match=complaint):
            run(TINY, path)
        assert path.read_text(encoding="utf-8") == wrong


def test_the_decompositions_tables_are_shown_beside_the_papers() -> None:
    # Two solves of 40 POIs: gaps 0 and 10 %, 2 and 5 optimality cuts, 10 and 20 subtour cuts, 1 and 4 s.
    rows = [row(40, "lshaped", optimality=2, subtour=10), row(40, "auto"),
            row(40, "lshaped", fuel=3.0, bound=110.0, process_s=4.0, optimality=5, subtour=20)]
    assert cells(cuts_table(rows), "40") == ["40", "2", "1", "35", "3.5", "15935", "15", "2.35", "5"]
    assert cells(runtime_table(rows), "40", "paper") == ["40", "paper", "30", "3600", "2640", "3600", "1518"]
    # deviation of 1 and 4 about 2.5: sqrt((1.5^2 + 1.5^2) / 1) = 2.12
    assert cells(runtime_table(rows), "40", "ours") == ["40", "ours", "1.0", "4.0", "2.5", "2.5", "2.1"]
    assert cells(gaps_table(rows), "40", "`lshaped` (c)")[2:] == ["0 / 0 / 1.9 / 3.7 / 7.9", "0 / 2.5 / 5 / 7.5 / 10"]


def test_a_gap_is_relative_to_the_plan_and_none_where_it_is_proved() -> None:
    assert row(10, "dep", value=200.0, bound=210.0).gap_pct == pytest.approx(5.0)
    assert row(10, "dep", value=200.0, bound=200.0001, status="optimal").gap_pct == 0.0


def test_methods_that_contradict_each_other_are_called_out() -> None:
    honest = [row(10, "dep"), row(10, "auto"), row(10, "lshaped", value=90.0, bound=100.0)]
    assert "worth the same" in checks(honest)[0]
    assert "No plan is worth more" in checks(honest)[1]
    assert "THEY DIFFER by up to 0.1" in checks([row(10, "dep"), row(10, "auto", value=90.0, bound=90.0)])[0]
    assert "THAN ANOTHER METHOD'S BOUND" in checks([row(10, "dep"), row(10, "auto", value=90.0, bound=95.0)])[1]


def test_a_report_warns_that_the_machine_was_busy() -> None:
    late = row(10, "dep", bound=110.0, process_s=10.0)
    assert "busy" not in markdown([late], QUICK)
    # 4 s of processor time in 10 s
    assert "had 40 % of a core" in markdown([replace(late, process_s=4.0)], QUICK)


def test_a_report_of_an_incomplete_run_gives_its_extent(tmp_path: Path) -> None:
    text = write_report([row(10, "dep")], QUICK, tmp_path)
    assert "1 of 80 solves" in text
    assert "**10 s for each solve**" in text
    assert "Proved: `dep` 1 of 1." in text
    assert "by availability" not in text  # there is but one
    assert (tmp_path / "paper-runtimes.md").read_text(encoding="utf-8") == text
    assert "Nothing is solved" in markdown([], QUICK)


def test_the_shipped_report_agrees_with_its_rows() -> None:
    rows = read_rows(DOCS / "paper-runtimes.csv")
    study = replace(QUICK, time_limit_s=rows[0].time_limit_s)
    assert {one.case for one in rows} == set(study.cases())
    assert (DOCS / "paper-runtimes.md").read_text(encoding="utf-8") == markdown(rows, study, "paper-runtimes.png")


def test_the_picture_is_the_same_each_time(tmp_path: Path) -> None:
    rows = [row(pois, method, fuel=fuel, bound=100.0 + pois / 10)
            for pois in (10, 40) for method in METHODS for fuel in (2.25, 3.0)]
    for name in ("one.png", "other.png"):
        draw_gaps(rows, tmp_path / name)
    one = (tmp_path / "one.png").read_bytes()
    assert one[:4] == b"\x89PNG"
    assert one == (tmp_path / "other.png").read_bytes()


@pytest.mark.parametrize(("limit", "said"), [
    ("0", "must be finite and above 0"), ("nan", "expected at least 0.0"), ("inf", "expected a finite number"),
    ("-1", "expected at least 0.0")])
def test_a_limit_that_makes_no_sense_is_refused(
    limit: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line(["reproduce", "runtimes", f"--time-limit={limit}", "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_methods_can_be_solved_one_after_the_other_in_a_folder(folder: Path, tmp_path: Path) -> None:
    for methods in (("auto",), ("auto", "lshaped")):
        page = reproduce(replace(TINY, methods=methods), tmp_path / "parts")
        assert "--method auto" in page
        assert ("Table 2" in page) == ("lshaped" in methods)
    parts, whole = read_rows(tmp_path / "parts" / "paper-runtimes.csv"), read_rows(folder / "paper-runtimes.csv")
    assert [(one.case, one.value) for one in parts] == [
        (one.case, one.value) for method in ("auto", "lshaped") for one in whole if one.method == method]


@pytest.mark.parametrize(("method", "said"), [
    ("lsaped", "did you mean 'lshaped'?"), ("auto,auto", "given twice"), ("auto,", "an entry is empty")])
def test_methods_that_the_tables_do_not_have_are_refused(
    method: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line(["reproduce", "runtimes", "--method", method, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert run_command_line(["reproduce", "runtimes", "--out", str(tmp_path / "file" / "out")]) == 2
    assert "choose another" in capsys.readouterr().err


@pytest.mark.skipif(not PAPER.exists(), reason="the paper's source is not beside the project")
def test_the_papers_figures_are_carried_over_as_printed() -> None:
    text = PAPER.read_text(encoding="utf-8")
    tables = [[re.findall(r"[\d.]+|<1", line.replace("$", "").replace(",", "")) for line in part.splitlines()
               if re.match(r"\s*\d0\s*&", line)] for part in text.split(r"\toprule")]
    second, third = (table for table in tables if table)
    assert second == [[str(n), str(cuts.optimality), str(cuts.subtour), f"{cuts.gap_pct:.2f}" if cuts.gap_pct else "0"]
                      for n, cuts in TABLE_2.items()]
    assert third == [[str(n), time.least, time.most, time.mean, time.median, time.deviation]
                     for n, time in TABLE_3.items()]
    boxes = re.findall(r"lower whisker=([\d.]+), lower quartile=([\d.]+),\s*median=([\d.]+),\s*"
                       r"upper quartile=([\d.]+), upper whisker=([\d.]+)", text)
    names = ("least", "lower", "median", "upper", "most")
    assert [Box(**dict(zip(names, map(float, box), strict=True))) for box in boxes] == list(FIGURE_3.values())
