"""Reactions of one point and seed, as one job: all histories of failures are no range of trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.reactions import reaction_result
from sva_bench.batch.physics import refuse_failed_physics
from sva_bench.batch.shards import Reactions
from sva_bench.execution.case import Case
from sva_bench.execution.drives import Drives
from sva_bench.files.digest import digest
from sva_bench.mission.instance import Instance
from sva_bench.study.options import Options, reactions_of, settings_of
from sva_bench.study.recourse import Stage, observed, react_in_scenarios
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class ReactionsJob:
    """Execute the plans of a world's scenarios with every reaction.

    Attributes:
        world, costs: The world and its fuel costs.
        options: Seed, trials, rollouts, fidelity, the reactions, and when solves may stop.
        cases: Plans under their scenarios.
        instances: What the plans of each scenario were made for.
        drives: What was driven for the plans without reaction.
    """

    kind: ClassVar[str] = "reactions"
    kept: ClassVar[bool] = True
    result: ClassVar[Any] = Mapping[str, tuple[ReactionResult, ...]]
    world: World
    costs: Mapping[str, FuelCosts]
    options: Options
    cases: tuple[Case, ...]
    instances: Mapping[str, Instance]
    drives: Drives

    @property
    def key(self) -> str:
        """The mission, the plans without the time that they took, and how they are executed."""
        world, options = self.world, self.options
        plans = [(case.scenario.name, case.planner, case.plan.routes, case.plan.value, case.plan.bound,
                  case.plan.status) for case in self.cases]
        robots = [replace(robot, urdf=None) for robot in world.robots]  # its model says all of a URDF
        return digest(self.kind, world.obstacles, world.sites, robots, world.scenarios, world.execute_failure,
                      world.noise, world.passages, world.interaction, world.departures, self.costs, self.instances,
                      plans, settings_of(world, options), reactions_of(world, options), options.anticipate,
                      options.limits)

    @property
    def what(self) -> str:
        """For a person."""
        return "reactions"

    def run(self) -> dict[str, tuple[ReactionResult, ...]]:
        """Execute them; missions aren't kept."""
        settings = replace(settings_of(self.world, self.options), recorded=False)
        drives = Drives(hops=dict(self.drives.hops), routes=dict(self.drives.routes))
        executed = observed(self.world, self.costs, self.cases, settings, None, drives)
        found = react_in_scenarios(Stage(
            world=self.world, costs=self.costs, instances=self.instances, executed=executed, settings=settings,
            executor=None, drives=drives), self.options, reaction_result, lambda *_: None)
        refuse_failed_physics([*drives.hops.values(), *drives.whole.values(), *drives.of_missions])
        return {name: scenario.results for name, scenario in found.items()}

    def fits(self, result: Reactions) -> bool:
        """Of these scenarios, reactions and plans."""
        plans = ["stochastic", "deterministic", *(["anticipative"] if self.options.anticipate else [])]
        pairs = list(reactions_of(self.world, self.options))
        return list(result) == [scenario.name for scenario in self.world.scenarios] and all(
            [(found.policy, found.news) for found in results] == pairs
            and all(list(held) == plans for found in results for held in (found.plans, found.value_of_recourse))
            for results in result.values())
