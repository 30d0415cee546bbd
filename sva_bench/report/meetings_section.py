"""What robots met, on the page of a run: a map for each plan, and tables by obstacle and by cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from sva_bench.analysis.plan_names import ShownNames
from sva_bench.choices import MarkKind
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.page import figure, heading, note, table
from sva_bench.storage.stored_run import Content

if TYPE_CHECKING:
    from sva_bench.report.drawing import Mark

_ABOUT_M = 0.3
"""Contacts, and waits, that are so near to each other are one mark."""
_MOST_MAPS, _MOST_ROWS = 6, 25

Rows = Sequence[Mapping[str, Any]]


def meetings_section(content: Content) -> list[str]:
    """Contacts and waits of teams that keep their plans; nothing where there are none."""
    contacts, waits = ([row for row in table.to_pylist() if row["policy"] == "none"]
                       for table in (content.contacts, content.waits))
    if not contacts and not waits:
        return []
    shown = ShownNames(content.summary.scenarios)
    parts = [heading("What robots met on their way"), *_maps(content, contacts, waits, shown)]
    if contacts:
        parts.append(table(
            ["scenario", "plan", "robot", "touched", "contacts", "noise draws", "longest [s]", "stuck there"],
            _most(_by_cause(contacts, "solid", shown, lambda mine: [
                f"{max(row['lasts_s'] for row in mine):.1f}",
                str(len(_draws([row for row in mine if row["stuck"]])))])),
            words=(0, 1, 2, 3), caption="What hulls touched; obstacles are numbered as in the world file"))
    if waits:
        parts.append(_waits_table(waits, shown, None if content.world.meets else content.summary.rollouts))
    # Where robots meet, a leg depends on the whole mission that it is of.
    return [*parts, note("Each leg counts once in each mission that was played; missions alike are played once."
                         if content.world.meets else
                         "Each leg counts once under each noise draw, also one that a robot had to leave to others "
                         "since its mission had ended before.")]


def _waits_table(waits: Rows, shown: ShownNames, draws: int | None) -> str:
    """What robots waited for; in all, or a mission where each leg is driven once under each of so many draws."""
    return table(
        ["scenario", "plan", "robot", "waited for", "waits", "noise draws",
         "in all [s]" if draws is None else "a mission [s]"],
        _most(_by_cause(waits, "cause", shown, lambda mine: [
            f"{sum(row['lasts_s'] for row in mine) / (draws or 1):.1f}"])),
        words=(0, 1, 2, 3), caption="What robots waited for" + (
            "" if draws is None else "; the last column is the mean over noise draws"))


class _More(Protocol):
    def __call__(self, mine: Rows) -> list[str]:
        """Further cells of a row that sums up some."""


def _by_cause(rows: Rows, cause: str, shown: ShownNames, more: _More) -> list[tuple[int, list[str]]]:
    """Rows by scenario, plan, robot and cause, each with how many there are."""
    grouped: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        plan = shown.of(row["scenario"], row["planner"])
        grouped.setdefault((row["scenario"], plan, row["robot"], row[cause]), []).append(row)
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


def _maps(content: Content, contacts: Rows, waits: Rows, shown: ShownNames) -> list[str]:
    """A map for each plan on whose way something was met; plans with the same routes share one."""
    with holding_back_ctrl_c():
        from sva_bench.report.drawing import Overlays, draw_world, for_page

    named: dict[tuple[tuple[str, tuple[str, ...]], ...], list[tuple[str, str]]] = {}
    for key in content.stems:
        routes = tuple(sorted((robot, tuple(route)) for robot, route in content.routes[key].items()))
        named.setdefault(routes, []).append(key)
    figures: list[str] = []
    for keys in named.values():
        touched, waited = ([row for row in rows if (row["scenario"], row["planner"]) == keys[0]]
                           for rows in (contacts, waits))
        if not touched and not waited:
            continue
        what = ", ".join(f"{scenario} {shown.of(scenario, planner)}" for scenario, planner in keys)
        said = " and ".join(said for rows, said in (
            (touched, counted(len(touched), "contact")), (waited, counted(len(waited), "wait"))) if rows)
        drawn = draw_world(content.world, "svg", Overlays(marks=[*marks_of(waited, "wait"),
                                                                 *marks_of(touched, "contact")])).decode()
        figures.append(figure(for_page(drawn, f"met{len(figures)}", f"What robots met, {what}"),
                              f"{what}: {said} under {counted(content.summary.rollouts, 'noise draw')}."))
    left = len(figures) - _MOST_MAPS
    return [*figures[:_MOST_MAPS], *([note(f"{counted(left, 'more plan')} with contacts or waits: see the tables, and "
                                           "contacts.parquet and waits.parquet.")] if left > 0 else [])]


def marks_of(rows: Rows, kind: MarkKind) -> list[Mark]:
    """Marks of contacts or waits: those near to the first of them are one, with their number."""
    from sva_bench.report.drawing import Mark

    found: list[list[Mapping[str, Any]]] = []
    for row in rows:
        near = next((group for group in found if abs(group[0]["x_m"] - row["x_m"]) <= _ABOUT_M
                     and abs(group[0]["y_m"] - row["y_m"]) <= _ABOUT_M), None)
        if near is None:
            found.append([row])
        else:
            near.append(row)
    return [Mark(kind=kind, x_m=group[0]["x_m"], y_m=group[0]["y_m"], count=len(group),
                 stuck=any(row.get("stuck", False) for row in group)) for group in found]
