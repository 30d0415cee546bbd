"""What robots met on their way: which rows tell of it, and where a map marks it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sva_bench.choices import MarkKind
from sva_bench.report.overlays import Mark
from sva_bench.report.wording import listed
from sva_bench.storage.stored_run import Content

Rows = Sequence[Mapping[str, Any]]
Met = Mapping[MarkKind, Rows]
"""What was met, by kind."""

_ABOUT_M = 0.3
"""Contacts, and waits, that are so near to each other are one mark."""


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
