"""What the values of a varied key are worth: sentences and a table of the page and the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.compared_values import KeyComparison, ValueGain, ValueRow, shown_value
from sva_bench.analysis.results import Estimate
from sva_bench.files.printable import counted
from sva_bench.report.wording import listed, with_interval


def compared_title(found: KeyComparison) -> str:
    """What is compared with what, and what the intervals are over."""
    maps = {row.maps for row in found.rows}
    over = counted(max(maps), "map") if found.sample == "maps" and maps else found.sample
    return f"{found.key} against {shown_value(found.reference)}, over {over}"


def compared_answers(found: KeyComparison) -> list[str]:
    """For each scenario, which value is worth more than the reference, by the intervals that hold together.

    Scenarios of which the same is to be said share a sentence.
    """
    said: dict[str, list[str]] = {}
    for place in dict.fromkeys((row.scenario, row.others) for row in found.rows):
        rows = [row for row in found.rows if (row.scenario, row.others) == place and row.gain is not None]
        where = f"{place[0]} ({place[1]})" if place[1] else place[0]
        said.setdefault(_compared(found, rows), []).append(where)
    return [f"{listed(places)}: {words}." for words, places in said.items()]


def _compared(found: KeyComparison, rows: Sequence[ValueRow]) -> str:
    """What the values are worth in one scenario, beside the reference."""
    reference = shown_value(found.reference)
    better = [row for row in rows if row.gain and row.gain.distinguishable and row.gain.mean > 0]
    worse = [row for row in rows if row.gain and row.gain.distinguishable and row.gain.mean < 0]
    if not rows:
        return f"nothing to compare with {reference}, of which nothing is done"
    if all(row.gain and row.gain.ci95 is None and row.gain.mean == 0 for row in rows):
        return f"no difference from {reference} was met"
    if all(row.gain and row.gain.ci95 is None for row in rows):
        return "no interval; " + ("more maps would tell how maps differ" if found.sample == "maps"
                                  else "more trials or noise draws would give one")
    if not better and not worse:
        return f"what the plan collects can't be told apart from that with {reference}{_vss_all_the_same(rows)}"
    return "; ".join([*(_worth(row, reference, "more") for row in sorted(better, key=lambda row: -_mean(row))),
                      *(_worth(row, reference, "less") for row in sorted(worse, key=_mean))])


def _vss_all_the_same(rows: Sequence[ValueRow]) -> str:
    """By how much the VSS differs though what the plan collects doesn't distinguishably; nothing where neither does."""
    told = []
    for row in rows:
        gain = row.vss_gain
        if gain is not None and gain.distinguishable and gain.ci95_adjusted is not None:
            low, high = sorted(map(abs, gain.ci95_adjusted))
            told.append(f"{abs(gain.mean):.1f} {'more' if gain.mean > 0 else 'less'} with {shown_value(row.value)} "
                        f"[{low:.1f}, {high:.1f}]")
    return f", but planning for failures is worth {listed(told)}" if told else ""


def _mean(row: ValueRow) -> float:
    return 0.0 if row.gain is None else row.gain.mean


def _worth(row: ValueRow, reference: str, how: str) -> str:
    assert row.gain is not None
    assert row.gain.ci95_adjusted is not None
    low, high = sorted(map(abs, row.gain.ci95_adjusted))
    return f"{shown_value(row.value)} is worth {abs(row.gain.mean):.1f} {how} than {reference} [{low:.1f}, {high:.1f}]"


def compared_table(found: KeyComparison) -> tuple[list[str], tuple[int, ...], list[list[str]]]:
    """Headings, columns of words, and the cells of each value."""
    others, counts = any(row.others for row in found.rows), len({row.maps for row in found.rows}) > 1
    head = [*(["other settings"] if others else []), "scenario", "value", *(
        ["maps"] if counts else []), "executed [95 %]", "more [95 %]", "VSS [95 %]", "VSS, more [95 %]"]
    cells = [[*([row.others] if others else []), row.scenario, shown_value(row.value), *(
        [str(row.maps)] if counts else []), with_interval(row.executed), _gain(found, row, row.gain),
        with_interval(row.vss), _gain(found, row, row.vss_gain)] for row in found.rows]
    return head, tuple(range(2 + others)), cells


def values_table(found: KeyComparison) -> tuple[list[str], list[list[str]]]:
    """Headings and cells of a page's table, whose rows stand below their scenario."""
    counts = len({row.maps for row in found.rows}) > 1
    head = ["value", "more [95 %]", "executed [95 %]", "VSS, more [95 %]", "VSS [95 %]", *(["maps"] if counts else [])]
    cells = [[shown_value(row.value), _gain(found, row, row.gain), with_interval(row.executed),
              _gain(found, row, row.vss_gain), with_interval(row.vss), str(row.maps)][:len(head)] for row in found.rows]
    return head, cells


def _gain(found: KeyComparison, row: ValueRow, gain: ValueGain | None) -> str:
    if row.value == found.reference:
        return "the reference"
    return "" if gain is None else with_interval(Estimate(mean=gain.mean, ci95=gain.ci95_adjusted))


def compared_notes(comparisons: Sequence[KeyComparison]) -> list[str]:
    """What the figures mean."""
    if not comparisons:
        return []
    over = {"maps": "maps", "trials": "the trials of the one map"}[comparisons[0].sample]
    return ["Executed: value of the stochastic plan. More: paired differences, under the same maps, seeds, scenarios, "
            f"failures and noise draws; their intervals are over {over}, and those of one scenario hold together with "
            "95 %."]
