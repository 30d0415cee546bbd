"""What reacting is worth over maps, as a table of the terminal and of a batch's page."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.over_maps import GainOverMaps, ReactionOverMaps
from sva_bench.report.wording import with_interval


def reaction_table(rows: Sequence[ReactionOverMaps]) -> tuple[list[str], tuple[int, ...], list[list[str]]]:
    """Headings, columns of words, and the cells of each reaction; values are in per cent where maps have one."""
    varied = any(row.variant for row in rows)
    plans = list(dict.fromkeys(name for row in rows for name in row.value_of_recourse))
    head = [*(["variant"] if varied else []), "scenario", "reaction", "maps", "VSS",
            *(f"recourse, {name}" for name in plans), "VSS with recourse", "anticipation"]
    return head, tuple(range(2 + varied)), [
        [*([row.variant] if varied else []), row.scenario, f"{row.policy}, {row.news}", str(row.maps), _gain(row.vss),
         *(_gain(row.value_of_recourse[name]) if name in row.value_of_recourse else "" for name in plans),
         _gain(row.vss_with_recourse), _gain(row.anticipation)] for row in rows]


def _gain(gain: GainOverMaps) -> str:
    share = "" if gain.pct.mean is None else f", {gain.pct.mean:.1f} %"
    return with_interval(gain) + share
