"""What a batch is made of: jobs that depend on nothing but their content, and run anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from sva_bench.analysis.summaries import Facts
from sva_bench.arrays import FloatArray
from sva_bench.batch.physics import refuse_failed_physics
from sva_bench.batch.shards import Reactions, Shard, shard_of
from sva_bench.choices import PathPlanner
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives, RouteKey
from sva_bench.execution.driving import DriveTask, drive_tasks
from sva_bench.execution.execute import execute, settle_trials
from sva_bench.execution.orders import PlannedLegs
from sva_bench.execution.outcome import Driven
from sva_bench.files.digest import digest
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.robot.disturbance import UNDISTURBED
from sva_bench.robot.model import RobotModel
from sva_bench.study.costs import grounds_of, instance_of
from sva_bench.study.options import Options
from sva_bench.study.planning import Planned, plan_scenarios, with_calibration
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.times import TravelTimes, plan_travel_times
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class TravelTimesJob:
    """Plan the paths of one robot model in a world, or of one robot where robots meet.

    Attributes:
        world: The world.
        model: The model.
        planner: How.
        robot: Name of the robot; ``None`` where robots do not meet, and those of a model are alike.
    """

    kind: ClassVar[str] = "travel-times"
    kept: ClassVar[bool] = True
    result: ClassVar[Any] = TravelTimes
    world: World
    model: RobotModel
    planner: PathPlanner
    robot: str | None = None

    @property
    def key(self) -> str:
        """Obstacles and sites, not what robots earn, burn or fear: sweeps over those share it."""
        sites = [(site.name, site.x_m, site.y_m, site.heading_rad) for site in self.world.sites]
        if self.robot is None:
            return digest(self.kind, self.world.obstacles, sites, self.model, self.planner)
        names = [robot.name for robot in self.world.robots]
        berths_by = ([site.slots for site in self.world.sites], self.world.noise.localisation,
                     [robot.model.radius_m for robot in self.world.robots])
        return digest(self.kind, self.world.obstacles, sites, self.model, self.planner, berths_by,
                      names.index(self.robot))

    @property
    def what(self) -> str:
        """For a person."""
        return f"travel times of {self.robot or self.model.name}"

    def run(self) -> TravelTimes:
        """Plan them; berths are found here too, since there may be no room for them."""
        ground = self.world if self.robot is None else grounds_of(self.world)[self.robot].world
        return plan_travel_times(ground, self.model, self.planner)

    def fits(self, result: TravelTimes) -> bool:
        """Of these sites and this robot, with a path and a time for each pair."""
        n = len(self.world.sites)
        apart = ~np.eye(n, dtype=bool)
        return (result.sites == tuple(site.name for site in self.world.sites) and result.model == self.model
                and len(result.headings_rad) == len(result.paths) == n and all(len(row) == n for row in result.paths)
                and bool((result.time_ms[apart] > 0).all()) and not result.time_ms[~apart].any()
                and all((path is None) == (i == j) and (path is None or _is_path(path))
                        for i, row in enumerate(result.paths) for j, path in enumerate(row)))


def _is_path(path: FloatArray) -> bool:
    return path.ndim == 2 and path.shape[1] == 2 and len(path) > 1 and bool(np.isfinite(path).all())


@dataclass(frozen=True, eq=False, kw_only=True)
class PlansJob:
    """Make both plans for each scenario of a world."""

    kind: ClassVar[str] = "plans"
    kept: ClassVar[bool] = True
    result: ClassVar[Any] = Mapping[str, Planned]
    world: World
    costs: Mapping[str, FuelCosts]
    options: Options

    @property
    def key(self) -> str:
        """The instances, and when solves may stop; of a calibrated plan also what the twin makes of it."""
        calibrated: tuple[object, ...] = ()
        if self.options.calibrate is not None:
            world = self.world
            calibrated = (self.options.calibrate, world.noise, world.passages, world.sites, world.interaction,
                          world.departures, self.costs,
                          *((world.obstacles,) if world.meets else ()))  # ways round others
        instances = [instance_of(self.world, self.costs, scenario) for scenario in self.world.scenarios]
        return digest(self.kind, [s.name for s in self.world.scenarios], instances, self.world.plan_failure,
                      self.world.execute_failure, self.options.limits, self.options.evpi, self.options.informed,
                      self.options.assumptions, *calibrated)

    @property
    def what(self) -> str:
        """For a person."""
        return "plans"

    def run(self) -> dict[str, Planned]:
        """Make them."""
        planned = plan_scenarios(self.world, self.costs, self.options, lambda *_: None)
        return with_calibration(self.world, self.costs, planned, self.options, None, lambda *_: None)

    def fits(self, result: Mapping[str, Planned]) -> bool:
        """Of these scenarios, made for these instances, and feasible there."""
        return list(result) == [scenario.name for scenario in self.world.scenarios] and all(
            digest(planned.instance) == digest(instance_of(self.world, self.costs, scenario))
            and all(_is_plan(plan, planned.instance) for plan in (*planned.all_plans(), planned.worst) if plan)
            and (planned.calibrated is None) == (self.options.calibrate is None)
            and (planned.calibrated is None or _is_plan(planned.calibrated.plan, planned.calibrated.instance))
            for scenario, planned in zip(self.world.scenarios, result.values(), strict=True))


def _is_plan(plan: Plan, instance: Instance) -> bool:
    names, sites = {vehicle.name for vehicle in instance.vehicles}, set(instance.sites)
    return set(plan.routes) <= names and all(sites.issuperset(route) for route in plan.routes.values()) \
        and certify(instance, replace(plan, value=None)).feasible


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveJob:
    """Drive one course under some noise draws: from site to site in physics, a whole route by the twin.

    Attributes:
        tasks: The drives, which have all but their disturbance in common.
        what: For a person.
    """

    kind: ClassVar[str] = "drives"
    kept: ClassVar[bool] = True
    result: ClassVar[Any] = tuple[Driven, ...]
    tasks: tuple[DriveTask, ...]
    what: str

    @property
    def key(self) -> str:
        """The course and the disturbances: whose course it is doesn't matter, nor what else is driven."""
        return digest(self.kind, replace(self.tasks[0], disturbance=UNDISTURBED),
                      [task.disturbance for task in self.tasks])

    def run(self) -> tuple[Driven, ...]:
        """Drive it."""
        driven = drive_tasks(self.tasks)
        refuse_failed_physics(driven)
        return driven

    def fits(self, result: tuple[Driven, ...]) -> bool:
        """A drive for each disturbance, with a time for each leg, or for those until it got stuck."""
        return len(result) == len(self.tasks) and all(
            (0 < len(driven.leg_s) <= len(task.legs) if driven.stuck else len(driven.leg_s) == len(task.legs))
            and np.isfinite(driven.leg_s).all() and (driven.leg_s >= 0).all()
            for task, driven in zip(self.tasks, result, strict=True))


@dataclass(frozen=True, eq=False, kw_only=True)
class TrialsJob:
    """Settle a range of trials: a unit of a batch, which becomes a shard.

    Attributes:
        unit: Name of the unit, unique in its batch.
        world: The world.
        variant: What a sweep varied in it, for the table.
        cases: Plans under their scenarios.
        settings: Seed, rollouts and fidelity.
        first, trials: The range.
        facts: What is known of the plans before any trial.
        drives: All routes driven, but for ``physics``, which needs ``costs`` to make its own.
        planned: What each leg of the routes takes as planned.
        reactions: What came of its point and seed with reactions, of the first range of trials.
    """

    kind: ClassVar[str] = "trials"
    kept: ClassVar[bool] = False
    result: ClassVar[Any] = Shard
    unit: str
    world: World
    variant: str
    cases: tuple[Case, ...]
    settings: Settings
    first: int
    trials: int
    facts: Facts
    drives: Mapping[RouteKey, Driven]
    planned: PlannedLegs
    costs: Mapping[str, FuelCosts]
    reactions: Reactions

    @property
    def key(self) -> str:
        """The unit's name: a batch has each of its units once."""
        return f"{self.kind}:{self.unit}"

    @property
    def what(self) -> str:
        """For a person."""
        return f"trials {self.first} to {self.first + self.trials - 1}"

    def run(self) -> Shard:
        """Settle them."""
        settings = replace(self.settings, first=self.first, trials=self.trials, recorded=False)
        if settings.fidelity == "physics" or self.world.meets:
            drives = Drives()
            executed = execute(self.world, self.costs, self.cases, settings, drives=drives)
            refuse_failed_physics([*drives.whole.values(), *drives.of_missions])
        else:
            executed = settle_trials(self.world, self.cases, settings, self.drives, self.planned)
        return shard_of(self.world, self.variant, executed, settings, self.facts, self.reactions)

    def fits(self, result: Shard) -> bool:
        """The shard of its trials."""
        return (result.note.first, result.note.trials) == (self.first, self.trials)
