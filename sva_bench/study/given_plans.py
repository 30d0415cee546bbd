"""Given plans, read and checked as far as possible without travel times."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sva_bench.errors import ExitCode, SvaBenchError
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_file import read_plan
from sva_bench.world.model import World

_log = logging.getLogger(__name__)


class InfeasiblePlan(SvaBenchError):
    """A plan that its certificate finds infeasible."""

    exit_code = ExitCode.INFEASIBLE_PLAN

    def __init__(self, which: Path | str, reasons: Sequence[str], *, undrivable: bool = False) -> None:
        super().__init__(which, reasons)
        self.which, self.reasons, self.undrivable = which, reasons, undrivable

    def __reduce__(self) -> tuple[object, ...]:
        return _infeasible, (self.which, self.reasons, self.undrivable)

    def __str__(self) -> str:
        change = "no robot could drive that, even where infeasible plans are allowed: mend the plan" \
            if self.undrivable else "mend the plan, raise the limits in the world file, or drive it all the same " \
            "with --allow-infeasible (allow_infeasible=True in Python)"
        return f"{self.which}: the plan is infeasible:\n  " + "\n  ".join([*self.reasons, change])


def _infeasible(which: Path | str, reasons: Sequence[str], undrivable: bool) -> InfeasiblePlan:
    return InfeasiblePlan(which, reasons, undrivable=undrivable)


def read_plans(world: World, paths: Mapping[str, Path]) -> dict[str, Plan]:
    """The plans of some files for a world, by name.

    Raises:
        BadFile: If a file is no plan, or names robots or sites that the world doesn't have.
        InfeasiblePlan: If a plan is infeasible for any travel times.
    """
    instance = without_times(world)
    return {name: drivable(world, instance, read_plan(path, instance), path) for name, path in paths.items()}


def drivable(world: World, instance: Instance, plan: Plan, which: Path | str) -> Plan:
    """The plan, if it could be driven in a world, whatever the travel times.

    Args:
        world: The world.
        instance: The world's, as ``without_times`` gives it; it knows all robots and sites of the plan.
        plan: The plan.
        which: Its file, or what else it is called.

    Raises:
        InfeasiblePlan: If it couldn't.
    """
    names = {instance_name(world), *(instance_name(world, scenario.name) for scenario in world.scenarios)}
    if plan.instance is not None and plan.instance not in names:
        _log.warning("%s was made for %s, not for %s", which, plan.instance, world.name)
    certificate = certify(instance, replace(plan, value=None))
    if not certificate.feasible:
        raise InfeasiblePlan(which, certificate.reasons, undrivable=True)
    return plan


def instance_name(world: World, scenario: str | None = None) -> str:
    """Name of the instance of a world's scenario, or of the availabilities under ``robots:``."""
    return world.name if scenario is None else f"{world.name}-{scenario}"


def without_times(world: World) -> Instance:
    """The world's instance with all costs 0: a plan infeasible for it is infeasible for any travel times."""
    sites = tuple(site.name for site in world.sites)
    free, nothing = np.zeros((len(sites), len(sites))), np.zeros(len(sites))
    return Instance(
        name=world.name, sites=sites, base=0, stations=tuple(sites.index(site.name) for site in world.stations),
        stop_s=nothing, vehicles=tuple(Vehicle(
            name=robot.name, fuel_capacity_s=np.inf, mission_limit_s=np.inf, availability=1.0, fuel_s=free,
            incentives=nothing) for robot in world.robots))
