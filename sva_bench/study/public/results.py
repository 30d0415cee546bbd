"""What ``run`` and ``execute`` give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import pyarrow as pa

from sva_bench.analysis.summaries import ComparisonSummary, Summary
from sva_bench.execution.case import Settings
from sva_bench.execution.executed import Executed
from sva_bench.execution.reacted import Reacted
from sva_bench.files.records import as_dict
from sva_bench.mission.plan import Plan
from sva_bench.storage.met_tables import contact_table, wait_table
from sva_bench.storage.outcome_table import outcome_table
from sva_bench.storage.run_folder import legs_of
from sva_bench.storage.tables import LEGS
from sva_bench.world.model import World

SummaryT = TypeVar("SummaryT", Summary, ComparisonSummary)


@dataclass(frozen=True, eq=False, kw_only=True)
class Result(Generic[SummaryT]):
    """What was measured.

    Attributes:
        world: The world.
        summary: What it comes to: the content of ``summary.json``.
        folder: The run folder; ``None`` if none was asked for.
        settings: How plans were executed.
        executed: Every case, trial by trial, as arrays.
        reacted: The same of teams that react, for each policy and news.
    """

    world: World
    summary: SummaryT
    folder: Path | None
    settings: Settings
    executed: tuple[Executed, ...]
    reacted: tuple[Reacted, ...] = ()

    @property
    def plans(self) -> Mapping[str, Mapping[str, Plan]]:
        """Plans by scenario and planner, or the name they were given by."""
        found: dict[str, dict[str, Plan]] = {}
        for run in self.executed:
            found.setdefault(run.case.scenario.name, {})[run.case.planner] = run.case.plan
        return found

    @property
    def outcomes(self) -> pa.Table:
        """A row per scenario, plan, reaction, trial and robot, as in ``outcomes.parquet``; ``.to_pandas()`` where
        pandas is."""
        robots = [robot.name for robot in self.world.robots]
        runs: list[Executed | Reacted] = [*self.executed, *self.reacted]
        return pa.concat_tables([outcome_table(run, robots, self.settings) for run in runs])

    @property
    def legs(self) -> pa.Table:
        """A row per leg that was driven, with times as planned and as driven [s], as in ``legs.parquet``."""
        return pa.table(vars(legs_of([*self.executed, *self.reacted])), schema=LEGS)

    @property
    def contacts(self) -> pa.Table:
        """A row each time that a hull came to touch an obstacle on a leg, as in ``contacts.parquet``."""
        return contact_table([*self.executed, *self.reacted])

    @property
    def waits(self) -> pa.Table:
        """A row for each wait on a leg, as in ``waits.parquet``."""
        return wait_table([*self.executed, *self.reacted])

    def as_dict(self) -> dict[str, Any]:
        """The summary as ``summary.json`` holds it."""
        return as_dict(self.summary)

    def __repr__(self) -> str:
        where = "" if self.folder is None else f"\nwritten to {self.folder}"
        return f"{self.summary!r}{where}"

    def _repr_html_(self) -> str:
        """The summary as a notebook's table."""
        return self.summary._repr_html_()
