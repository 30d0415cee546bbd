"""The problem that a solution method proves: goal, instance, incumbent and shared knowledge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sva_bench.choices import Cuts
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import Clock, Knowledge, Progress
from sva_bench.solver.outcomes import Outcomes
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.routes.heuristic import STARTS
from sva_bench.solver.routes.packing import Route


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """A goal on an instance, in the solver's own units, and the incumbent.

    Attributes:
        instance: The instance.
        scopes: Legs and bounds of each vehicle.
        goal: What to maximise.
        known: What earlier solves found; methods add to it.
        clock: Time left.
        gap: Gap at which a plan counts as optimal.
        progress: The incumbent and its bound, which the method improves.
        recourse: The second stage; ``None`` in the collapsed model.
        cuts: Kind of optimality cuts of the L-shaped method.
        starts: Starts of the heuristic.
        routes: Routes that the heuristic found, each with its vehicle: initial columns.
    """

    instance: Instance
    scopes: tuple[Scope, ...]
    goal: Goal
    known: Knowledge
    clock: Clock
    gap: float
    progress: Progress
    recourse: Outcomes | None = None
    cuts: Cuts = "single"
    starts: int = STARTS
    routes: Sequence[Route] = ()

    @property
    def second_stage(self) -> Outcomes:
        """The second stage, for the methods that keep it explicitly.

        Raises:
            ValueError: If the problem has none.
        """
        if self.recourse is None:
            raise ValueError("this method needs a second stage")
        return self.recourse
