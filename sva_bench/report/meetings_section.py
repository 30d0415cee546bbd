"""What robots met on their way, on the page of a run: a map for each plan, and tables by obstacle, robot and cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from sva_bench.analysis.plan_names import ShownNames
from sva_bench.choices import MarkKind
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.overlays import Mark, Overlays
from sva_bench.report.page import figure, heading, note, table
from sva_bench.report.stands import stands_of
from sva_bench.report.styles import MARKS, MARKS_OF_MANY
from sva_bench.report.wording import listed
from sva_bench.storage.stored_run import Content

_ABOUT_M = 0.3
"""Contacts, and waits, that are so near to each other are one mark."""
_MOST_MAPS, _MOST_ROWS = 6, 25

Rows = Sequence[Mapping[str, Any]]
Met = Mapping[MarkKind, Rows]
"""What was met, by kind."""


def meetings_section(content: Content) -> list[str]:
    """Contacts, collisions and waits of teams that keep their plans; nothing where there are none."""
    met = met_in(content)
    if not any(met.values()):
        return []
    shown = ShownNames(content.summary.scenarios)
    parts = [heading("What robots met on their way"), *_maps(content, met, shown)]
    if met["contact"]:
        parts.append(table(
            ["scenario", "plan", "robot", "touched", "contacts", "noise draws", "longest [s]", "stuck there"],
            _most(_by(met["contact"], ("robot", "solid"), shown, lambda mine: [
                f"{max(row['lasts_s'] for row in mine):.1f}",
                str(len(_draws([row for row in mine if row["stuck"]])))])),
            words=(0, 1, 2, 3), caption="Obstacles that hulls touched, numbered as in the world file"))
    if met["collision"]:
        parts.append(table(
            ["scenario", "plan", "robots", "collisions", "noise draws", "ended a robot"],
            _most(_by(met["collision"], ("robots",), shown, lambda mine: [str(sum(row["stuck"] for row in mine))])),
            words=(0, 1, 2), caption="Robots that collided"))
    if met["wait"]:
        parts.append(_waits_table(met["wait"], shown, None if content.world.meets else content.summary.rollouts))
    # Where robots meet, a leg depends on the whole mission that it is of.
    return [*parts, note("Each leg counts once in each mission that was played; missions alike are played once."
                         if content.world.meets else
                         "Each leg counts once under each noise draw, also one that a robot had to leave to others "
                         "since its mission had ended before.")]


def met_in(content: Content) -> Met:
    """What teams that keep their plans met; each collision once, though it stands in the legs of both robots."""
    contacts, waits = ([row for row in table.to_pylist() if row["policy"] == "none"]
                       for table in (content.contacts, content.waits))
    robots = [robot.name for robot in content.world.robots] if content.world.meets else []
    return {"contact": [row for row in contacts if row["solid"] not in robots],
            "collision": collisions([row for row in contacts if row["solid"] in robots], robots), "wait": waits}


def collisions(rows: Rows, robots: Sequence[str]) -> Rows:
    """Collisions with the names of both ``robots``, and whether any of the two was ``stuck`` by it.

    A robot whose mission was over has no leg that would tell of one, so of two robots in a mission the one that tells
    of more has them all.
    """
    told: dict[tuple[Any, ...], dict[str, list[Mapping[str, Any]]]] = {}
    for row in rows:
        both = tuple(sorted((row["robot"], row["solid"]), key=robots.index))
        mine = told.setdefault((row["scenario"], row["planner"], row["trial"], row["rollout"], both), {})
        mine.setdefault(row["robot"], []).append(row)
    found = []
    for (*_, both), by_robot in told.items():
        most = max(by_robot.values(), key=len)
        found += [{**row, "robots": listed(both), "stuck": any(
            others[number]["stuck"] for others in by_robot.values() if number < len(others))}
            for number, row in enumerate(most)]
    return found


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


def _maps(content: Content, met: Met, shown: ShownNames) -> list[str]:
    """A map for each plan on whose way something was met; plans that met the same share one."""
    with holding_back_ctrl_c():
        from sva_bench.report.canvas import for_page
        from sva_bench.report.drawing import draw_world

    stands, figures = stands_of(content.world), list[str]()
    for keys in _alike(content, met):
        mine = {kind: [row for row in rows if (row["scenario"], row["planner"]) == keys[0]]
                for kind, rows in met.items()}
        if not any(mine.values()):
            continue
        what = ", ".join(f"{scenario} {shown.of(scenario, planner)}" for scenario, planner in keys)
        said = listed([counted(len(rows), MARKS[kind][2], MARKS_OF_MANY[kind])
                       for kind, rows in mine.items() if rows])
        drawn = draw_world(content.world, "svg", Overlays(stands=stands, marks=[
            mark for kind in ("wait", "contact", "collision") for mark in marks_of(mine[kind], kind)])).decode()
        figures.append(figure(for_page(drawn, f"met{len(figures)}", f"What robots met, {what}"),
                              f"{what}: {said} under {counted(content.summary.rollouts, 'noise draw')}."))
    left = len(figures) - _MOST_MAPS
    return [*figures[:_MOST_MAPS], *([note(f"{counted(left, 'more plan')} with contacts, collisions or waits: see the "
                                           "tables, and contacts.parquet and waits.parquet.")] if left > 0 else [])]


def _alike(content: Content, met: Met) -> list[list[tuple[str, str]]]:
    """Plans, by scenario and planner, that met the same: those of the same routes.

    Where robots meet, what a robot meets depends on who is there, and so on the scenario too.
    """
    places: dict[tuple[str, str], set[tuple[Any, ...]]] = {key: set() for key in content.stems}
    if content.world.meets:
        for kind, rows in met.items():
            for row in rows:
                places.setdefault((row["scenario"], row["planner"]), set()).add(
                    (kind, *(row[name] for name in ("rollout", "robot", "leg", "since_s", "x_m", "y_m"))))
    alike: dict[tuple[Any, ...], list[tuple[str, str]]] = {}
    for key in content.stems:
        routes = tuple(sorted((robot, tuple(route)) for robot, route in content.routes[key].items()))
        alike.setdefault((routes, frozenset(places[key])), []).append(key)
    return list(alike.values())


def marks_of(rows: Rows, kind: MarkKind) -> list[Mark]:
    """Marks of contacts, collisions or waits: those near to the first of them are one, with their number."""
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
