"""A request for one plan, checked before anything that takes long is loaded."""

from __future__ import annotations

from dataclasses import dataclass

from sva_bench.choices import Cuts, Method, Objective, RiskKind
from sva_bench.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """A request for one plan.

    Attributes:
        objective: Plan for failures, or take every robot as available.
        method: Solution method, for the proof of optimality.
        cuts: Optimality cuts of ``lshaped``; ``None`` = single.
        risk: Measure of risk; ``None`` = the expected value.
        beta, weight, target: Of the measure; ``None`` = its default.

    Raises:
        BadInput: If some of these exclude each other.
    """

    objective: Objective = "stochastic"
    method: Method = "auto"
    cuts: Cuts | None = None
    risk: RiskKind | None = None
    beta: float | None = None
    weight: float | None = None
    target: float | None = None

    def __post_init__(self) -> None:
        if self.risk is not None and (self.objective != "stochastic" or self.method != "auto"):
            raise BadInput("--risk goes with the stochastic objective and the method auto alone")
        if (self.risk == "excess") != (self.target is not None):
            raise BadInput("--risk excess and --target go together")
        if self.beta is not None and self.risk != "cvar":
            raise BadInput("--beta belongs to --risk cvar")
        if self.weight is not None and self.risk is None:
            raise BadInput("--weight is the share of a measure of risk: choose one with --risk cvar or --risk excess")
        if self.cuts is not None and self.method != "lshaped":
            raise BadInput("--cuts are those of --method lshaped")
