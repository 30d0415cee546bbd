"""The paper's tables of runtimes (section 5.1) again, ours beside its own, from the rows of ``solves``."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median, stdev
from typing import TypeVar

from sva_bench.errors import BadInput
from sva_bench.files.printable import counted
from sva_bench.paper.printed import FIGURE_3, FIGURE_3_LETTERS, LIMIT_S, TABLE_2, TABLE_3, Box, box_of
from sva_bench.paper.solves import FULL, METHODS, VEHICLES, Row, Study, read_rows, run

NAME = "paper-runtimes"
QUICK = replace(FULL, pois=(10, 20, 40, 60), seeds=(0,), availabilities=(0.75,), time_limit_s=10.0)
"""Under ten minutes on an idle core: four sizes, one seed, one availability, all fuel capacities and methods."""
DECOMPOSITION = "lshaped"
"""The method that the paper's tables are of."""
Key = TypeVar("Key", float, tuple[float, ...])
_AGREE = 2e-6  # relative; each solve is proved within 1e-6
_IDLE = 0.9  # of a core, from which on a machine counts as idle


def reproduce(study: Study, folder: Path, on_row: Callable[[int, int, Row], None] = lambda done, of, row: None) -> str:  # noqa: ARG005
    """Solve what is not solved yet, and write rows, report and picture into a folder; the report.

    Files: ``paper-runtimes.csv`` (the rows), ``paper-runtimes.md``, ``paper-runtimes.png``.

    Args:
        study: What to solve.
        folder: Where; a second call goes on with what is missing there.
        on_row: Called after each solve with the cases done, all cases, and the new row.

    Raises:
        SvaBenchError: If the folder holds something else, or can't be written to.
        KeyboardInterrupt: After Ctrl-C; the report of what is done is written all the same.
    """
    path = folder / f"{NAME}.csv"
    try:
        rows = run(study, path, on_row)
    except KeyboardInterrupt:
        cases = set(study.cases())
        write_report([row for row in read_rows(path) if row.case in cases], study, folder)
        raise
    return write_report(rows, study, folder)


def write_report(rows: Sequence[Row], study: Study, folder: Path) -> str:
    """Write report and picture of some rows into a folder; the report."""
    from sva_bench.paper.gaps_picture import draw_gaps  # matplotlib takes its time to load

    if not rows:
        return markdown(rows, study)
    text = markdown(rows, study, f"{NAME}.png")
    try:
        draw_gaps(rows, folder / f"{NAME}.png")
        (folder / f"{NAME}.md").write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written ({error.strerror}); choose another folder with --out") from None
    return text


def markdown(rows: Sequence[Row], study: Study, picture: str | None = None) -> str:
    """The report.

    Args:
        rows: Rows of the study, perhaps not all of them.
        study: What was asked for.
        picture: File name of the picture of gaps, if there is one.
    """
    if not rows:
        return "# The paper's runtimes again\n\nNothing is solved yet.\n"
    asked = sum(1 for _ in study.cases())
    parts = [
        "# The paper's runtimes again",
        f"Section 5.1 of Venkatachalam & Smereka, on {', '.join(sorted({row.processor for row in rows}))}, one thread, "
        f"**{study.time_limit_s:g} s for each solve** (the paper: an hour of CPLEX 12.9 on a Xeon E5630). "
        f"{len(rows)} of {asked} solves: {_grid(study)}. Times are processor time; the limit is one of wall-clock "
        "time. A gap is bound minus plan in per cent of the plan, as CPLEX has it; 0.0001 % counts as none."
        + _busy(rows),
        f"Proved: {_proofs(rows)}.",
        f"Made by `{_command(study)}`; its rows are in the `.csv` beside this file.",
        "Methods: `dep` is the paper's formulation (its *a*), `relaxed` its reformulation (*b*), `lshaped` its "
        "decomposition (*c*); `expected` is the one-stage model that the three collapse to, and `auto` what "
        "`sva-bench plan` takes unasked. All of them begin with the heuristic's plan.",
        *(_decomposition(rows) if _of(rows, DECOMPOSITION) else ()),
        "## Gaps (Figure 3)", f"![Box plots of gaps]({picture})" if picture else "", gaps := gaps_table(rows),
        ("Least / lower quartile / median / upper quartile / greatest gap in per cent; the" if gaps else "The")
        + " picture's whiskers reach to the least and the greatest. A square is a box without height.",
        "## All methods by number of POIs",
        methods_table(rows, "POIs", lambda row: row.pois),
        "BD and SEC are averages. All but `lshaped` have subtour cuts only: those of their last program.",
        *_section("## All methods by fuel capacity, in largest distances", rows, "F", lambda row: row.fuel_multiple),
        *_section("## All methods by availability of the second vehicle", rows, "availability",
                  lambda row: row.availability),
        "## Checks", "\n".join(f"- {line}" for line in checks(rows)),
        "## What the paper leaves open", "\n".join(f"- {line}" for line in _left_open(study)),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _decomposition(rows: Sequence[Row]) -> list[str]:
    """The paper's two tables of its decomposition."""
    return [
        "## Cuts and gap of the decomposition (Table 2)", cuts_table(rows),
        "BD: optimality cuts, SEC: subtour cuts, averages; up to the limit where a solve met it. The paper adds its "
        "cuts while CPLEX branches. HiGHS takes none there, so ours come between runs of the master program, and a "
        "limit that ends the first run leaves one optimality cut and no subtour cut. Ours count a subtour cut for each "
        "POI of a component that is not connected with the base, and for each vehicle; the paper has one a component.",
        "## Runtime of the decomposition (Table 3)", runtime_table(rows),
        f"In seconds. A solve that met its limit counts with the time it took: {LIMIT_S:g} in the paper.",
    ]


def cuts_table(rows: Sequence[Row]) -> str:
    """Table 2: cuts and average gap of the decomposition, ours beside the paper's."""
    lines = []
    for pois, group in _groups(_of(rows, DECOMPOSITION), lambda row: row.pois):
        paper = TABLE_2.get(int(pois))
        lines.append([
            str(pois), str(len(group)), str(_proved(group)),
            str(paper.optimality) if paper else "", f"{fmean(row.optimality_cuts for row in group):.1f}",
            str(paper.subtour) if paper else "", f"{fmean(row.subtour_cuts for row in group):.0f}",
            f"{paper.gap_pct:g}" if paper else "", _percent(fmean(row.gap_pct for row in group))])
    return _table(["POIs", "solves", "proved", "BD, paper", "BD, ours", "SEC, paper", "SEC, ours", "gap %, paper",
                   "gap %, ours"], lines)


def runtime_table(rows: Sequence[Row]) -> str:
    """Table 3: runtime of the decomposition, the paper's above ours."""
    lines = []
    for pois, group in _groups(_of(rows, DECOMPOSITION), lambda row: row.pois):
        paper, taken = TABLE_3.get(int(pois)), [row.process_s for row in group]
        if paper:
            lines.append([str(pois), "paper", paper.least, paper.most, paper.mean, paper.median, paper.deviation])
        lines.append([str(pois), "ours", *(_seconds(s) for s in (
            min(taken), max(taken), fmean(taken), median(taken))), _seconds(stdev(taken)) if len(taken) > 1 else ""])
    return _table(["POIs", "", "min", "max", "avg", "med", "std"], lines)


def gaps_table(rows: Sequence[Row]) -> str:
    """Figure 3 in figures: the boxes of the paper's three methods, ours beside the paper's."""
    lines = []
    for (pois, method), paper in FIGURE_3.items():
        group = [row for row in _of(rows, method) if row.pois == pois]
        if group:
            lines.append([str(pois), f"`{method}` ({FIGURE_3_LETTERS[method]})", _five(paper),
                          _five(box_of([row.gap_pct for row in group]))])
    return _table(["POIs", "method", "paper", "ours"], lines) if lines else ""


def methods_table(rows: Sequence[Row], title: str, key: Callable[[Row], float]) -> str:
    """What all methods came to, for each value of a key."""
    lines = []
    for value, group in _groups(rows, key):
        for method in METHODS:
            its = _of(group, method)
            if its:
                taken, gaps = [row.process_s for row in its], [row.gap_pct for row in its]
                lines.append([
                    f"{value:g}", f"`{method}`", str(len(its)), str(_proved(its)), _seconds(median(taken)),
                    _seconds(max(taken)), _percent(fmean(gaps)), _percent(max(gaps)),
                    f"{fmean(row.optimality_cuts for row in its):.1f}" if method == DECOMPOSITION else "",
                    f"{fmean(row.subtour_cuts for row in its):.0f}"])
    return _table([title, "method", "solves", "proved", "time s, median", "max", "gap %, average", "max", "BD", "SEC"],
                  lines)


def checks(rows: Sequence[Row]) -> list[str]:
    """What must hold between rows, in words: methods agree, no plan beats a bound, limits are kept."""
    spread, excess, compared = 0.0, 0.0, 0
    for _, group in _groups(rows, lambda row: (row.pois, row.seed, row.fuel_multiple, row.availability)):
        proved = [row.value for row in group if row.status == "optimal"]
        compared += len(proved) > 1
        scale = max(1.0, *(row.value for row in group))
        if proved:
            spread = max(spread, (max(proved) - min(proved)) / scale)
        excess = max(excess, (max(row.value for row in group) - min(row.bound for row in group)) / scale)
    slowest = max(rows, key=lambda row: row.wall_s - row.time_limit_s)
    over = slowest.wall_s - slowest.time_limit_s
    return [
        f"On {compared} instances two methods or more proved their plans; " + (
            "these are worth the same." if spread <= _AGREE else
            f"**THEY DIFFER by up to {spread:.2g} of their value: one of them is wrong.**"),
        "No plan is worth more than another method's bound." if excess <= _AGREE else
        f"**A PLAN IS WORTH MORE THAN ANOTHER METHOD'S BOUND, by {excess:.2g} of its value: that bound is wrong.**",
        "Every solve ended with a plan, which an independent check found feasible; the slowest "
        + (f"ran {over:.1f} s over its limit of {slowest.time_limit_s:g} s (`{slowest.method}`, {slowest.pois} POIs)."
           if over > 0 else "kept its limit."),
    ]


def _left_open(study: Study) -> list[str]:
    return [
        "The instances themselves: these are drawn anew, by the paper's rule and our seeds.",
        f"The mission limit: {study.tau:g} times the fuel capacity here (`--tau`). With 1, one filling lasts for the "
        "whole mission and stations hardly matter; with 2 every POI can be visited.",
        "Where base and stations are: (50, 50), and (25 or 75, 25 or 75).",
        "At which half of the POIs the first vehicle earns nothing: drawn. Incentives are not rounded.",
        "The gap at which the paper's solves stopped.",
        "How many solves there were: \"about 240 random instances\", where six sizes, five seeds and four fuel "
        "capacities make 120, and 480 with the four availabilities. The whole grid here has all 480, for each method.",
        "The paper says that up to 30 POIs were solved optimally, and about 90 % of 40; but by its Table 3 a solve of "
        "30 met the limit, and with 40 at least half of them did. Both are carried over as printed.",
    ]


def _command(study: Study) -> str:
    """The command that makes, or goes on with, a study of the shipped kinds."""
    chosen = "" if study.methods == METHODS else "".join(f" --method {method}" for method in study.methods)
    return f"sva-bench reproduce runtimes{' --whole' if study.pois == FULL.pois else ''}{chosen}"


def _grid(study: Study) -> str:
    def listed(values: Iterable[float], unit: str = "") -> str:
        return ", ".join(f"{value:g}{unit}" for value in values)
    return (f"{listed(study.pois)} POIs; seeds {listed(study.seeds)}; fuel capacities of "
            f"{listed(study.fuel_multiples)} largest distances; availability of the second of {VEHICLES} vehicles "
            f"{listed((100 * p for p in study.availabilities), ' %')}; {counted(len(study.methods), 'method')}")


def _of(rows: Sequence[Row], method: str) -> list[Row]:
    return [row for row in rows if row.method == method]


def _groups(rows: Sequence[Row], key: Callable[[Row], Key]) -> list[tuple[Key, list[Row]]]:
    return [(value, list(group)) for value, group in itertools.groupby(sorted(rows, key=key), key)]


def _proved(rows: Sequence[Row]) -> int:
    return sum(row.status == "optimal" for row in rows)


def _busy(rows: Sequence[Row]) -> str:
    """A warning if the solves that met the limit had to share their core."""
    shares = [row.process_s / row.wall_s for row in rows if row.status == "time_limit" and row.wall_s > 0]
    if not shares or fmean(shares) >= _IDLE:
        return ""
    return (" **The machine was busy with other work**: solves that met the limit had "
            f"{100 * fmean(shares):.0f} % of a core on average; on an idle one gaps are smaller.")


def _proofs(rows: Sequence[Row]) -> str:
    """How many solves of each method ended with a proof."""
    counts = [(method, _of(rows, method)) for method in METHODS]
    return ", ".join(f"`{method}` {_proved(its)} of {len(its)}" for method, its in counts if its)


def _section(title: str, rows: Sequence[Row], column: str, key: Callable[[Row], float]) -> list[str]:
    """A table of all methods under its title, unless it would say again what others say."""
    return [title, methods_table(rows, column, key)] if len({key(row) for row in rows}) > 1 else []


def _five(box: Box) -> str:
    return " / ".join(_percent(figure) for figure in (box.least, box.lower, box.median, box.upper, box.most))


def _seconds(seconds: float) -> str:
    return f"{seconds:.2f}" if seconds < 1 else f"{seconds:.1f}"


def _percent(percent: float) -> str:
    return f"{percent:.2f}".rstrip("0").rstrip(".")


def _table(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rule = ["---" if k == 0 or not title or title == "method" else "---:" for k, title in enumerate(header)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, rule, *lines))
