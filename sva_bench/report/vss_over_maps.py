"""What planning for failures is worth over the maps of a batch, in sentences that say what their intervals allow."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sva_bench.analysis.over_maps import BatchSummary, OverMaps
from sva_bench.files.printable import counted
from sva_bench.report.wording import FEW_MAPS, listed, with_interval

_PAYS, _COSTS, _NONE, _EVEN, _UNSURE = "pays", "costs", "no difference", "can't be told", "no interval"
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
    pays = [row for row in rows if _verdict(row) == _PAYS]
    if not pays:
        return f"{over} no scenario shows a value of planning for failures beyond doubt."
    if not variants:  # the interval that is shown is the one that the verdict rests on
        where = listed([f"{row.scenario} (VSS {with_interval(row.vss)})" for row in pays])
        return f"{over} planning for failures pays in {where}."
    count = {name: sum(row.scenario == name for row in pays) for name in dict.fromkeys(row.scenario for row in pays)}
    every, some = ([name for name in count if (count[name] == variants) == all_of] for all_of in (True, False))
    said = [*([f"for every variant in {listed(every)}"] if every else []),
            *([f"for some variants in {listed(some)}"] if some else [])]
    return f"{over} planning for failures pays {' and '.join(said)}."


def verdicts_of(rows: Sequence[OverMaps], short: Callable[[str], str]) -> str:
    """For which variants planning for failures pays and for which it can't be told, under one scenario."""
    said: dict[str, list[OverMaps]] = {}
    for row in rows:
        said.setdefault(_verdict(row), []).append(row)
    if len(said) == 1:
        ((verdict, _),) = said.items()
        return f"{verdict} for any variant" + (f" ({_range(rows)})" if verdict in (_PAYS, _COSTS) else "")
    return "; ".join(f"{verdict} for {listed([short(row.variant) for row in said[verdict]])}" + (
        f" ({_range(said[verdict])})" if verdict in (_PAYS, _COSTS) else "")
        for verdict in (_PAYS, _COSTS, _EVEN, _UNSURE, _NONE_HERE, _NONE) if verdict in said)


def _range(rows: Sequence[OverMaps]) -> str:
    """The VSS with its interval, or the least and the greatest of several."""
    if len(rows) == 1:
        return f"VSS {with_interval(rows[0].vss)}"
    means = [row.vss.mean for row in rows]
    return f"VSS {min(means):.1f} to {max(means):.1f}"


def _verdict(row: OverMaps) -> str:
    ends = row.vss.ci95
    if ends is None:
        return _UNSURE if row.vss.mean or row.maps == 1 else _NONE_HERE
    if ends == (0.0, 0.0):
        return _NONE
    return _PAYS if ends[0] > 0 else _COSTS if ends[1] < 0 else _EVEN
