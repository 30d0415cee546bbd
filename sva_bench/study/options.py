"""The options of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sva_bench.analysis.calibration import Target, target_of, target_text
from sva_bench.analysis.precision import Precision
from sva_bench.choices import Fidelity, News, PathPlanner, PolicyName
from sva_bench.execution.case import Settings
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.reacting import Reaction, pairs_of
from sva_bench.study.recordings import Ask
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class Options:
    """The options of a run.

    Attributes:
        seed: Root seed of failures and noise; plans don't depend on it.
        trials: Trials of each plan in each scenario.
        rollouts: Number of noise draws.
        fidelity: How plans are executed.
        planner: How paths are planned.
        limits: When a solve may stop.
        evpi: Compute the value of perfect information for any number of outcomes.
        informed: Execute the perfect-information plans too.
        assumptions: Execute the plans for each failure process under each.
        policies: What the team does about failures, each measured; empty = what the world says.
        news: When it learns of one, each measured with each policy; empty = what the world says.
        anticipate: Make a plan for each reaction too.
        calibrate: What a calibrated plan is made for: the greatest share of bad missions, or the greatest value;
            ``None`` = none is made.
        precision: Stopping rule, by which trials and noise draws grow; ``None`` = fixed numbers.
        record: Trials that are recorded beside the typical ones; results don't depend on them.
    """

    seed: int = 0
    trials: int = 1000
    rollouts: int = 32
    fidelity: Fidelity = "rollout"
    planner: PathPlanner = "prmstar"
    limits: SolveLimits = field(default_factory=SolveLimits)
    evpi: bool = False
    informed: bool = False
    assumptions: bool = False
    policies: tuple[PolicyName, ...] = ()
    news: tuple[News, ...] = ()
    anticipate: bool = False
    calibrate: Target | None = None
    precision: Precision | None = None
    record: tuple[Ask, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Everything that changes results, as asked for; what isn't asked for is left out."""
        asked: dict[str, Any] = {} if self.precision is None else {
            "precision_pct": self.precision.pct, "max_trials": self.precision.max_trials,
            **({"anytime": True} if self.precision.anytime else {})}
        asked |= {key: list(words) for key, words in (("policies", self.policies), ("news", self.news)) if words}
        asked |= {"anticipate": True} if self.anticipate else {}
        asked |= {} if self.calibrate is None else {"calibrate": target_text(self.calibrate)}
        return {**asked, "informed": self.informed, "assumptions": self.assumptions, "trials": self.trials,
                "rollouts": self.rollouts, "fidelity": self.fidelity, "planner": self.planner,
                "time_limit_s": self.limits.time_limit_s, "gap": self.limits.gap, "evpi": self.evpi}

    @classmethod
    def from_dict(cls, seed: int, told: Mapping[str, Any]) -> Options:
        """The options that ``as_dict`` has told, as they stand in ``manifest.json``, with the seed beside them."""
        precision = None
        if "precision_pct" in told:
            precision = Precision(pct=told["precision_pct"], max_trials=told["max_trials"],
                                  anytime=told.get("anytime", False))
        return cls(
            seed=seed, trials=told["trials"], rollouts=told["rollouts"], fidelity=told["fidelity"],
            planner=told["planner"], limits=SolveLimits(time_limit_s=told["time_limit_s"], gap=told["gap"]),
            evpi=told["evpi"], informed=told["informed"], assumptions=told["assumptions"], precision=precision,
            policies=tuple(told.get("policies", ())), news=tuple(told.get("news", ())),
            anticipate=told.get("anticipate", False),
            calibrate=target_of(told["calibrate"]) if "calibrate" in told else None)


def reactions_of(world: World, options: Options) -> tuple[Reaction, ...]:
    """Policy and news of each reaction to be measured beside none; empty if there is none."""
    return pairs_of(world, options.policies, options.news)


def identity_of(world: World, options: Options) -> dict[str, Any]:
    """What results in a world depend on, however it is asked for, by which runs are named.

    ``none`` is measured anyway, and naming the usual news or what the world says changes nothing. Reactions are left
    out where they are the world's own, so that names of runs stay theirs.
    """
    told = {key: value for key, value in options.as_dict().items() if key not in ("policies", "news")}
    pairs = reactions_of(world, options)
    return told if pairs == pairs_of(world, (), ()) else {**told, "reactions": [list(pair) for pair in pairs]}


def settings_of(world: World, options: Options) -> Settings:
    """How plans are executed in a world."""
    return Settings(seed=options.seed, trials=options.trials, fidelity=options.fidelity,
                    rollouts=options.rollouts if world.noisy else 1)
