"""What is executed, and how: one plan under one scenario, and the settings of all trials."""

from __future__ import annotations

from dataclasses import dataclass

from sva_bench.choices import Fidelity, News, PolicyName, Role
from sva_bench.mission.plan import Plan
from sva_bench.world.model import Scenario


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """One plan under one scenario, and what it is executed for.

    Attributes:
        scenario: The scenario.
        planner: What the plan goes by.
        plan: The plan.
        role: What it is executed for.
        policy: What the team does about news; ``none`` keeps the plan.
        news: When the team learns of a failure; ``never`` where the policy is ``none``.
    """

    scenario: Scenario
    planner: str
    plan: Plan
    role: Role = "given"
    policy: PolicyName = "none"
    news: News = "never"

    @property
    def key(self) -> tuple[str, str, PolicyName, News]:
        """Scenario, planner, policy and news by their names."""
        return self.scenario.name, self.planner, self.policy, self.news

    @property
    def title(self) -> str:
        """As shown to people."""
        reaction = "" if self.policy == "none" else f", {self.policy} on {self.news} news"
        return f"{self.scenario.name}, {self.planner}{reaction}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Settings:
    """How plans are executed.

    Attributes:
        seed: Root of failures and noise.
        trials: Number of trials.
        rollouts: Number of noise draws; trial t has that of rollout t mod ``rollouts``. 1 without noise.
        fidelity: ``kinematic`` (the twin), ``rollout`` (legs in physics, once per noise draw, composed) or ``physics``
            (every trial simulated whole).
        first: Number of the first trial: a range of trials is settled as if all before it had been too.
        recorded: Whether legs and traces are kept; a batch has no use for them.
    """

    seed: int
    trials: int
    rollouts: int
    fidelity: Fidelity
    first: int = 0
    recorded: bool = True
