"""What planning for failures is worth over the maps of a batch, in sentences that say what their intervals allow."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sva_bench.analysis.over_maps import BatchSummary, OverMaps
from sva_bench.files.printable import counted
from sva_bench.report.wording import FEW_MAPS, listed, with_interval

_PAYS, _COSTS, _NONE, _EVEN, _UNSURE = "pays", "costs", "no difference", "can't be told", "no interval"
_ALIKE = "the same on all maps"
"""Maps that agree on a VSS other than nothing: no interval, yet often the clearest result of a batch."""
_NONE_HERE = "no difference on these maps"


def headline_over_maps(summary: BatchSummary) -> str:
    """What a batch comes to without reaction, which is said where teams react too; one map tells nothing either way."""
    rows = summary.aggregate
    said = _headline(rows, variants=len(summary.variants) if any(summary.variants) else 0)
    told = summary.reactions and any(row.maps > 1 for row in rows)
    return f"If the team keeps its plan, {said[0].lower()}{said[1:]}" if told else said


def _headline(rows: Sequence[OverMaps], *, variants: int) -> str:
    if rows and all(row.maps == 1 for row in rows):
        return "One map can't tell what planning for failures is worth over maps; below is its worth on this one."
    most = max((row.maps for row in rows), default=0)
    few = "at most " if len({row.maps for row in rows}) > 1 else "only " if most < FEW_MAPS else ""
    over = f"Over {few}{counted(most, 'map')}"
    pays, alike = ([row for row in rows if _verdict(row) == verdict] for verdict in (_PAYS, _ALIKE))
    same = f"on {_all(alike)} the VSS is the same {_where(alike, variants)}, which has no interval over maps" \
        if alike else ""
    if pays:
        return f"{over} planning for failures pays {_where(pays, variants)}." + (f" O{same[1:]}." if alike else "")
    if not alike:
        return f"{over} no scenario shows a value of planning for failures beyond doubt."
    # It is a finding of these maps, and none that an interval over maps could confirm.
    rest = "" if {row.scenario for row in rows} == {row.scenario for row in alike} else \
        "; no other scenario shows a value of planning for failures beyond doubt"
    return f"O{same[1:]}{rest}."


def _where(rows: Sequence[OverMaps], variants: int) -> str:
    """In which scenarios, with their VSS, or where settings vary for how many variants of which scenarios."""
    if not variants:  # the interval that is shown is the one that the verdict rests on
        return f"in {listed([f'{row.scenario} (VSS {with_interval(row.vss)})' for row in rows])}"
    count = {name: sum(row.scenario == name for row in rows) for name in dict.fromkeys(row.scenario for row in rows)}
    every, some = ([name for name in count if (count[name] == variants) == all_of] for all_of in (True, False))
    return " and ".join([*([f"for every variant in {listed(every)}"] if every else []),
                         *([f"for some variants in {listed(some)}"] if some else [])])


def _all(rows: Sequence[OverMaps]) -> str:
    """``all 3 maps``."""
    numbers = {row.maps for row in rows}
    return "all maps" if len(numbers) > 1 else "both maps" if numbers == {2} else f"all {counted(max(numbers), 'map')}"


def verdicts_of(rows: Sequence[OverMaps], short: Callable[[str], str]) -> str:
    """For which variants planning for failures pays and for which it can't be told, under one scenario."""
    said: dict[str, list[OverMaps]] = {}
    for row in rows:
        said.setdefault(_verdict(row), []).append(row)
    if len(said) == 1:
        ((verdict, _),) = said.items()
        return _told(verdict, rows, "any variant")
    return "; ".join(_told(verdict, said[verdict], listed([short(row.variant) for row in said[verdict]]))
                     for verdict in (_PAYS, _COSTS, _ALIKE, _EVEN, _UNSURE, _NONE_HERE, _NONE) if verdict in said)


def _told(verdict: str, rows: Sequence[OverMaps], which: str) -> str:
    if verdict == _ALIKE:
        return f"the same on {_all(rows)} for {which} ({_range(rows)})"
    return f"{verdict} for {which}" + (f" ({_range(rows)})" if verdict in (_PAYS, _COSTS) else "")


def _range(rows: Sequence[OverMaps]) -> str:
    """The VSS with its interval, or the least and the greatest of several."""
    if len(rows) == 1:
        return f"VSS {with_interval(rows[0].vss)}"
    means = [row.vss.mean for row in rows]
    least, most = f"{min(means):.1f}", f"{max(means):.1f}"
    return f"VSS {least}" if least == most else f"VSS {least} to {most}"


def _verdict(row: OverMaps) -> str:
    ends = row.vss.ci95
    if ends is None:
        return _UNSURE if row.maps == 1 else _ALIKE if row.vss.mean else _NONE_HERE
    if ends == (0.0, 0.0):
        return _NONE
    return _PAYS if ends[0] > 0 else _COSTS if ends[1] < 0 else _EVEN
