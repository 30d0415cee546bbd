"""What a method has to prove, and all that it may use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sva_bench.choices import Cuts
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import Clock, Knowledge, Progress
from sva_bench.solver.outcomes import Outcomes
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.routes.packing import Route


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """A goal on an instance, in the solver's own units, and the best plan so far.

    Attributes:
        instance: The instance.
        scopes: What each vehicle may do.
        goal: What to maximise.
        known: What earlier solves found; methods add to it.
        clock: Time left.
        gap: Gap at which a plan counts as optimal.
        progress: The best plan so far and its bound, which the method improves.
        recourse: The second stage; ``None`` where it is not kept.
        cuts: Optimality cuts of the L-shaped method.
        routes: Routes that the heuristic met, each with its vehicle; good columns to begin with.
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
    routes: Sequence[Route] = ()

    @property
    def second_stage(self) -> Outcomes:
        """The second stage, for the methods that keep it.

        Raises:
            ValueError: If there is none.
        """
        if self.recourse is None:
            raise ValueError("this method needs a second stage")
        return self.recourse
