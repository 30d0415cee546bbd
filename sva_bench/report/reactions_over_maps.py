"""What reacting is worth over maps: sentences of a batch's page, and a table of the page and the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.over_maps import GainOverMaps, ReactionOverMaps
from sva_bench.choices import News, PolicyName
from sva_bench.report.reaction_wording import Answer, condition, few_of
from sva_bench.report.wording import with_interval


def answers_over_maps(rows: Sequence[ReactionOverMaps]) -> list[Answer]:
    """What planning for failures is worth over maps to a team that reacts, in a sentence for each policy and news.

    News that come to the same, in the digits shown, share a sentence; no news has its own.
    """
    found: dict[tuple[PolicyName, bool, str], list[News]] = {}
    for policy, news in dict.fromkeys((row.policy, row.news) for row in rows):
        said = _worth([row for row in rows if (row.policy, row.news) == (policy, news)])
        found.setdefault((policy, news == "never", said), []).append(news)
    return [Answer(condition(policy, news), (said,)) for (policy, _, said), news in found.items()]


_PAYS, _LOSES = "planning for failures is worth ", "the deterministic plan is worth more in "
_EVEN = "the value of planning for failures is not distinguishable from zero in "
_ZERO, _UNSURE = "both plans are worth exactly the same in ", "VSS, which has no interval over maps, is "


def _worth(rows: Sequence[ReactionOverMaps]) -> str:
    """VSS under one policy and news, by the interval that is shown."""
    said: dict[str, list[str]] = {verdict: [] for verdict in (_PAYS, _LOSES, _EVEN, _ZERO, _UNSURE)}
    for row in rows:
        vss = row.vss
        if vss.ci95 is None:
            said[_UNSURE].append(f"{vss.mean:.1f} in {row.label}")
        elif not vss.excludes_zero:
            said[_ZERO if vss.ci95 == (0.0, 0.0) else _EVEN].append(row.label)
        elif vss.mean > 0:
            said[_PAYS].append(f"{with_interval(vss)} in {row.label}")
        else:
            said[_LOSES].append(f"{row.label} (VSS {with_interval(vss)})")
    return "; ".join(verdict + few_of(those) for verdict, those in said.items() if those) + "."


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
