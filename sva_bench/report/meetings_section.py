"""What robots met on their way, on the page of a run, in tables by obstacle, robot and cause; maps show where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from sva_bench.analysis.plan_names import ShownNames
from sva_bench.report.marks import Rows, met_in
from sva_bench.report.page import heading, note, table
from sva_bench.storage.stored_run import Content

_MOST_ROWS = 25


def meetings_section(content: Content) -> list[str]:
    """Contacts, collisions and waits of teams that keep their plans; nothing where there are none."""
    met = met_in(content)
    if not any(met.values()):
        return []
    shown = ShownNames(content.summary.scenarios)
    parts = [heading("What robots met on their way")]
    if met["contact"]:
        parts.append(table(
            ["scenario", "plan", "robot", "touched", "contacts", "noise draws", "longest [s]", "stuck [draws]"],
            _most(_by(met["contact"], ("robot", "solid"), shown, lambda mine: [
                f"{max(row['lasts_s'] for row in mine):.1f}", _stuck(mine)])),
            words=(0, 1, 2, 3), caption="Obstacles that hulls touched" + (
                # The file of a world on an occupancy grid names no boxes.
                ", numbered as in the world file" if content.world.map_source is None else
                "; boxes are pieces of the map's occupied area, and the maps of the plans show where")))
    if met["collision"]:
        parts.append(table(
            ["scenario", "plan", "robots", "collisions", "noise draws", "stuck [draws]"],
            _most(_by(met["collision"], ("robots",), shown, lambda mine: [_stuck(mine)])),
            words=(0, 1, 2), caption="Robots that collided"))
    if met["wait"]:
        parts.append(_waits_table(met["wait"], shown, None if content.world.meets else content.summary.rollouts))
    # Where robots meet, a leg depends on the whole mission that it is of.
    return [*parts, note("Each leg counts once in each mission that was played; missions alike are played once."
                         if content.world.meets else
                         "Each leg counts once under each noise draw, also one that a robot had to leave to others "
                         "since its mission had ended before: a robot may be stuck here that in no mission came so "
                         'far, and isn\'t under "How the robots ended".')]


def _stuck(mine: Rows) -> str:
    """Under how many noise draws a robot got stuck."""
    return str(len(_draws([row for row in mine if row["stuck"]])))


def _waits_table(waits: Rows, shown: ShownNames, draws: int | None) -> str:
    """What robots waited for; in all, or a mission where each leg is driven once under each of so many draws."""
    return table(
        ["scenario", "plan", "robot", "waited for", "waits", "noise draws",
         "in all [s]" if draws is None else "a mission [s]"],
        _most(_by(waits, ("robot", "cause"), shown, lambda mine: [
            f"{sum(row['lasts_s'] for row in mine) / (draws or 1):.1f}"])),
        words=(0, 1, 2, 3), caption="What robots waited for" + (
            "" if draws is None else "; the last column is the mean over noise draws"))


class _More(Protocol):
    def __call__(self, mine: Rows) -> list[str]:
        """Further cells of a row that sums up some."""


def _by(rows: Rows, names: Sequence[str], shown: ShownNames, more: _More) -> list[tuple[int, list[str]]]:
    """Rows by scenario, plan and some columns of names, each with how many there are."""
    grouped: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        plan = shown.of(row["scenario"], row["planner"])
        grouped.setdefault((row["scenario"], plan, *(row[name] for name in names)), []).append(row)
    return [(len(mine), [*key, str(len(mine)), str(len(_draws(mine))), *more(mine)]) for key, mine in grouped.items()]


def _most(rows: list[tuple[int, list[str]]]) -> list[list[str]]:
    """The most frequent first, and no more than fit a page."""
    ordered = [row for _, row in sorted(rows, key=lambda item: -item[0])]
    if len(ordered) <= _MOST_ROWS:
        return ordered
    width = len(ordered[0]) - 4
    return [*ordered[:_MOST_ROWS], [f"and {len(ordered) - _MOST_ROWS} more rows", "", "", *[""] * (width + 1)]]


def _draws(rows: Rows) -> set[int]:
    return {row["rollout"] for row in rows}
