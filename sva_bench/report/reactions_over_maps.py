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


def reaction_table(rows: Sequence[ReactionOverMaps], *, narrow: bool
                   ) -> tuple[list[str], tuple[int, ...], list[list[str]]]:
    """Headings, columns of words, and the cells of each reaction.

    Args:
        rows: The reactions.
        narrow: Whether per cent stand in a second line, and not in a column of their own.
    """
    varied = any(row.variant for row in rows)
    plans = list(dict.fromkeys(name for row in rows for name in row.value_of_recourse))
    figures = ["VSS", *(f"recourse, {name}" for name in plans), "VSS with recourse", "anticipation"]
    shown = [name if name in _OF_BEST else f"{name}\n[%]" for name in figures] if narrow else [
        heading for name in figures for heading in ((name, f"{name} [%]") if name not in _OF_BEST else (name,))]
    cells = [[*([row.variant] if varied else []), row.scenario, f"{row.policy}, {row.news}", str(row.maps),
              *(cell for name, gain in zip(figures, (
                  row.vss, *(row.value_of_recourse.get(plan) for plan in plans), row.vss_with_recourse,
                  row.anticipation), strict=True)
                for cell in _gain(gain, narrow=narrow and name not in _OF_BEST)[:1 if name in _OF_BEST else 2])]
             for row in rows]
    return [*(["variant"] if varied else []), "scenario", "reaction", "maps", *shown], tuple(range(2 + varied)), cells


_OF_BEST = ("VSS with recourse", "anticipation")
"""What is stored in per cent of the best plan's value: beside VSS, of the stochastic one's, that would only puzzle."""


def _gain(gain: GainOverMaps | None, *, narrow: bool) -> tuple[str, ...]:
    """A figure in incentive, and in per cent where maps have a percentage."""
    amount = "" if gain is None else with_interval(gain)
    share = "" if gain is None or gain.pct.mean is None else f"{gain.pct.mean:.1f}"
    return ("\n".join(part for part in (amount, share) if part),) if narrow else (amount, share)
