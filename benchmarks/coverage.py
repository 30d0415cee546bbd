"""How often intervals hold the truth, on outcomes as missions give them: the table of docs/statistics.md.

Each mission's routes are driven under many noise draws by the kinematic twin (in 8800 robot trials none ended
otherwise in physics). They are the population; its mean over failures is exact. Each round takes a few draws of it and
fresh failures, and lets the program itself settle the trials and make the intervals.

    python -m benchmarks.coverage [--rounds N] [--draws N] [WORLD...]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sva_bench.analysis.figures import difference_figure, end_figures, value_figure
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.statistics import controlled, estimate
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS, End, FailureProcess
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import RouteKey
from sva_bench.execution.driving import drive_tasks
from sva_bench.execution.execute import drives_ahead, settle_trials
from sva_bench.execution.orders import PlannedLegs, planned_legs
from sva_bench.execution.outcome import Assignment, Driven, RobotFate
from sva_bench.execution.rules import settle
from sva_bench.mission.certify import expected_value
from sva_bench.mission.failures import NEVER
from sva_bench.mission.plan import Route
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import plan_scenarios
from sva_bench.world.load import load_world
from sva_bench.world.model import World

WORLDS = Path(__file__).parents[1] / "worlds"
NOISE = (1.0, 2.0, 4.0)
"""Multiples of the worlds' noise: the more, the more draws have a robot run dry."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Population:
    """A mission driven under many noise draws.

    Attributes:
        world: The world.
        cases: Its plans, scenario by scenario.
        expected: Closed-form value of each case, by scenario and planner.
        drives: Drives by robot, route, draw and 0.
        planned: What each leg of the routes takes as planned.
        draws: How many draws.
    """

    world: World
    cases: tuple[Case, ...]
    expected: Mapping[tuple[str, str], float]
    drives: Mapping[RouteKey, Driven]
    planned: PlannedLegs
    draws: int


def population(world: World, draws: int) -> Population:
    """Plan a world's mission and drive its routes."""
    costs = plan_costs(world, "prmstar", lambda *_: None)
    planned = plan_scenarios(replace(world, plan_failure="mission"), costs, Options(), lambda *_: None)
    cases, expected = [], {}
    for scenario in world.scenarios:
        plans = planned[scenario.name]
        for name, plan in (("stochastic", plans.stochastic), ("deterministic", plans.deterministic)):
            cases.append(Case(scenario=scenario, planner=name, plan=plan))
            truth = replace(plans.instance, failure=world.execute_failure)
            expected[scenario.name, name] = expected_value(truth, plan)
    settings = Settings(seed=10_000, trials=draws, rollouts=draws, fidelity="kinematic", recorded=False)
    ahead = drives_ahead(world, costs, tuple(cases), settings)
    return Population(world=world, cases=tuple(cases), expected=expected, draws=draws,
                      planned=planned_legs(world, costs, cases),
                      drives=ahead.drives([drive_tasks(chunk.tasks) for chunk in ahead.chunks]).routes)


class Truths:
    """What missions come to on average over all draws of a population and over failures, exactly."""

    def __init__(self, of: Population) -> None:
        self._of = of
        self._known: dict[tuple[str, Route, FailureProcess], tuple[FloatArray, FloatArray]] = {}

    def value(self, case: Case) -> float:
        """Expected incentive of a case."""
        return sum(self._robot(case, m)[0] for m in range(len(self._of.world.robots)))

    def share(self, case: Case, robot: int, end: End) -> float:
        """Probability of an end."""
        return float(self._robot(case, robot)[1][ENDS.index(end)])

    def _robot(self, case: Case, number: int) -> tuple[float, FloatArray]:
        robot = self._of.world.robots[number]
        process, route = self._of.world.execute_failure, case.plan.route(robot.name)
        p = case.scenario.availability[robot.name]
        if not route:
            return 0.0, np.eye(len(ENDS))[ENDS.index("home")]
        earned, ended = self._by_failure(robot.name, route, process)
        pois = len(earned) - 1
        chances = np.array([1 - p, p]) if process == "mission" else np.array(
            [p**k * (1 - p) for k in range(pois)] + [p**pois])
        return float(chances @ earned), chances @ ended

    def _by_failure(self, robot: str, route: Route, process: FailureProcess) -> tuple[FloatArray, FloatArray]:
        """Mean incentive and shares of ends if it fails before its k-th POI, for each k and for never."""
        key = robot, route, process
        if key not in self._known:
            world = self._of.world
            robots = {r.name: r for r in world.robots}
            orders = Assignment(
                robot=robot, route=route, stations=frozenset(site.name for site in world.stations),
                incentives=robots[robot].incentives, stop_s={site.name: site.stop_s for site in world.sites},
                fuel_capacity_s=robots[robot].fuel_capacity_s, mission_limit_s=robots[robot].mission_limit_s)
            pois = sum(orders.is_poi(site) for site in route)
            kinds = [0, NEVER] if process == "mission" else [*range(1, pois + 1), NEVER]
            outcomes = [[settle(orders, self._of.drives[robot, route, draw, 0], RobotFate(fails_before))
                         for draw in range(self._of.draws)] for fails_before in kinds]
            self._known[key] = (
                np.array([np.mean([o.incentive for o in row]) for row in outcomes]),
                np.array([[np.mean([o.end == end for o in row]) for end in ENDS] for row in outcomes]))
        return self._known[key]


def intervals(of: Population, truths: Truths, rollouts: int, trials: int, seed: int
              ) -> Iterator[tuple[str, str, Estimate, float]]:
    """Kind of interval, scenario, interval and truth of one round."""
    rng = np.random.default_rng([seed, rollouts])
    chosen = rng.choice(of.draws, rollouts, replace=False)
    drives = {(robot, route, k, 0): of.drives[robot, route, int(draw), 0]
              for robot, route in {key[:2] for key in of.drives} for k, draw in enumerate(chosen)}
    settings = Settings(seed=seed, trials=trials, rollouts=rollouts, fidelity="kinematic", recorded=False)
    runs = settle_trials(of.world, of.cases, settings, drives, of.planned)
    noisy = not of.world.noise.silent
    for s, d in zip(runs[::2], runs[1::2], strict=True):
        name = s.case.scenario.name
        worth = [truths.value(run.case) for run in (s, d)]
        promised = [of.expected[name, run.case.planner] for run in (s, d)]
        for run, truth, known in zip((s, d), worth, promised, strict=True):
            figure = value_figure(run, noisy=noisy)
            yield "mean", name, estimate(figure), truth
            yield "mean, controlled", name, controlled(figure, known), truth
            for m, robot in enumerate(run.robots):
                if run.case.plan.route(robot):
                    for end, share in end_figures(run, m, noisy=noisy).items():
                        yield f"share {end}", name, estimate(share), truths.share(run.case, m, end)
        if not s.case.plan.drives_like(d.case.plan):
            beyond = difference_figure(s, d, noisy=noisy)
            yield "VSS", name, estimate(beyond), worth[0] - worth[1]
            yield "VSS, controlled", name, controlled(beyond, promised[0] - promised[1]), worth[0] - worth[1]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", nargs="*", default=[path.stem for path in sorted(WORLDS.glob("*.yaml"))])
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--rollouts", type=int, nargs="*", default=[4, 8, 16, 32])
    parser.add_argument("--noise", type=float, nargs="*", default=list(NOISE))
    parser.add_argument("--process", choices=["mission", "per_leg"], default="mission")
    told = parser.parse_args()
    print("| noise | world | scenario | interval | " + " | ".join(f"K = {k}" for k in told.rollouts) + " |")
    shares: dict[tuple[float, str], dict[int, list[float]]] = {}
    for noise in told.noise:
        for name in told.worlds:
            world = load_world(WORLDS / f"{name}.yaml")
            world = replace(world, execute_failure=told.process, noise=replace(
                world.noise, wheel_gain_sd=noise * world.noise.wheel_gain_sd))
            of = population(world, told.draws)
            truths = Truths(of)
            held: dict[tuple[str, str], dict[int, list[tuple[bool, float, bool]]]] = {}
            for rollouts in told.rollouts:
                for seed in range(told.rounds):
                    for kind, scenario, found, truth in intervals(of, truths, rollouts, told.trials, seed):
                        assert found.ci95 is not None
                        low, high = found.ci95
                        slack = 1e-9 * max(1.0, abs(truth))
                        held.setdefault((scenario, kind), {}).setdefault(rollouts, []).append(
                            (low - slack <= truth <= high + slack, high - low, high - low <= slack))
            for (scenario, kind), by in sorted(held.items()):
                cells = []
                for rollouts, rounds in by.items():
                    hit, width, flat = np.array(rounds, dtype=np.float64).T
                    if not flat.all():  # a certainty is no interval
                        shares.setdefault((noise, kind), {}).setdefault(rollouts, []).append(100 * float(hit.mean()))
                    cells.append(f"{100 * hit.mean():.1f} ({width.mean():.3g}"
                                 + (f", flat {100 * flat.mean():.0f}" if flat.any() else "") + ")")
                print(f"| {noise:g} | {name} | {scenario} | {kind} | " + " | ".join(cells) + " |", flush=True)
    print("\nOver worlds and scenarios, the least in brackets:\n")
    print("| noise | interval | " + " | ".join(f"K = {k}" for k in told.rollouts) + " |")
    for (noise, kind), by_draws in shares.items():
        cells = [f"{np.mean(by_draws[k]):.1f} ({min(by_draws[k]):.1f})" if k in by_draws else "" for k in told.rollouts]
        print(f"| {noise:g} | {kind} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
