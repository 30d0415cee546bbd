"""Legs as planned and as driven, on the page of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.analysis.plan_names import ShownNames
from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.page import figure, heading, note, table
from sva_bench.storage.run_folder import Legs
from sva_bench.storage.stored_run import Content

_WORST_LEGS = 10
_CUT_SHORT = ("not driven to the end, since the robot failed, ran out of fuel or got stuck on the way, left out here; "
              "legs.parquet has them, as cut_short.")
_WAITED = " Waits on the way are not in it: they take time, and of fuel the robot's idle_share."
_HELD = (" A robot that waits for another rolls on slowly meanwhile, so a leg with a wait may take less driving than "
         "planned.")


def legs_section(content: Content, shown: ShownNames) -> list[str]:
    """The section: a chart, a table by robot, and the legs that took longest beyond their plan.

    Legs that were cut short say nothing of how well times were predicted: of them it is said how many there are.
    """
    with holding_back_ctrl_c():
        from sva_bench.report import charts

    legs = content.legs.without_reaction()
    cut: BoolArray = np.array(legs.cut_short, dtype=np.bool_)
    whole = (legs.planned_s > 0) & ~cut
    parts = [heading("Time and fuel, planned against driven")]
    left_out = [note(f"{counted(int(cut.sum()), 'leg')} {_CUT_SHORT}")] if cut.any() else []
    if not whole.any():
        return [*parts, *(left_out or [note("No leg was driven.")])]
    planned, driven, names = legs.planned_s[whole], legs.driven_s[whole], np.array(legs.robot)[whole].tolist()
    order = [robot.name for robot in content.world.robots]
    told = (f"Each point is a leg {'of a mission that was played' if content.world.meets else 'under one noise draw'}. "
            "Fuel is measured in seconds of driving, so the driving time of a leg is its fuel."
            f"{_WAITED if legs.waited_s[whole].any() else ''}"
            f"{_HELD if content.world.interaction == 'shared' and legs.waited_s[whole].any() else ''}")
    return [*parts,
            figure(charts.legs_driven(planned, driven, names, order), told), *left_out,
            table(["robot", "legs", "planned [s]", "driven [s]", "off [%]", "least [%]", "most [%]"],
                  _by_robot(planned, driven, names, order)),
            table(["scenario", "plan", "robot", "noise draw", "from", "to", "planned [s]", "driven [s]", "off [s]"],
                  _worst(legs, np.flatnonzero(whole).tolist(), shown), words=(0, 1, 2, 4, 5),
                  caption="The legs that took longest beyond their plan")]


def _by_robot(planned: FloatArray, driven: FloatArray, names: Sequence[str], order: Sequence[str]) -> list[list[str]]:
    rows = []
    for robot in order:
        mine = np.array([name == robot for name in names])
        if mine.any():
            off = 100 * (driven[mine] / planned[mine] - 1)
            rows.append([robot, str(int(mine.sum())), f"{planned[mine].sum():.1f}", f"{driven[mine].sum():.1f}",
                         f"{100 * (driven[mine].sum() / planned[mine].sum() - 1):+.2f}", f"{off.min():+.2f}",
                         f"{off.max():+.2f}"])
    return rows


def _worst(legs: Legs, whole: Sequence[int], shown: ShownNames) -> list[list[str]]:
    off = legs.driven_s - legs.planned_s
    return [[legs.scenario[k], shown.of(legs.scenario[k], legs.planner[k]), legs.robot[k], str(legs.rollout[k]),
             legs.origin[k], legs.destination[k], f"{legs.planned_s[k]:.2f}", f"{legs.driven_s[k]:.2f}",
             f"{off[k]:+.2f}"] for k in sorted(whole, key=lambda k: -off[k])[:_WORST_LEGS]]
