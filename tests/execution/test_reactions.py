"""Teams with reactions against a dynamic program that shares nothing with the engine, and the laws that hold exactly.

Not laws, and not asserted: that a policy beats keeping the plan in expectation, or that earlier news are better for it.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sva_bench.choices import NEWS, FailureProcess, News
from sva_bench.execution.chance import Drawn
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.policies.policy import TeamState
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.rules import LegDriven
from sva_bench.execution.team import play
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.mission.failures import NEVER, RouteProfile, process_of
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.rest import Afield, Rest
from sva_bench.solver.two_stage import knowledge_of, plan_deterministic, plan_stochastic, wait_and_see
from tests.execution.reacting import (
    Enumerated,
    Heard,
    Kept,
    Plan,
    all_histories,
    enumerated,
    expected,
    keep,
    legs_of,
    resolve,
    team_of,
    value_of,
)
from tests.oracles.foresight import clairvoyant
from tests.oracles.reactions import Reactions
from tests.oracles.rest import Ground, Here
from tests.oracles.teams import random_plan, random_team

PROCESSES: tuple[FailureProcess, ...] = ("mission", "per_leg", "hazard")
CENTRAL: tuple[News, ...] = ("report", "instant")
EXACT = 1e-9  # sums of the same products in another order
SOLVED = 1e-6  # the gap at which a solve ends

over_processes = pytest.mark.parametrize("process", PROCESSES)
# The solver plans for neither lifetimes nor the cost of a loss.
over_solved = pytest.mark.parametrize("process", ["mission", "per_leg", "hazard"])


def setting(seed: int, process: FailureProcess, *, losses: bool = True) -> tuple[Instance, Ground, Plan]:
    """A tiny team and a plan; under ``hazard``, all that can leave at the start: see ``news_of``."""
    instance = random_team(seed, process, losses=losses)
    ground = Ground(instance)
    return instance, ground, random_plan(ground, seed, all_leave=process == "hazard")


def news_of(process: FailureProcess, plan: Plan) -> tuple[News, ...]:
    """News under which histories are exact: not where somebody who waits at the base sets off the moment that a
    lifetime ends, for a history sets off at the next event."""
    return NEWS[:-1] if process == "hazard" and not all(plan) else NEWS


def is_small(ground: Ground) -> bool:
    """Whether the best of all policies is found in no time."""
    return len(ground.robots) * len(ground.pois) <= 8 and len(ground.robots) + len(ground.stations) <= 4


def closed_form(instance: Instance, plan: Plan) -> float:
    """The value of a plan that is kept, by the failure process itself."""
    value = 0.0
    for vehicle, route in zip(instance.vehicles, plan, strict=True):
        stops = (instance.base, *route)
        until = np.cumsum([vehicle.fuel_s[leg] for leg in pairwise(stops)]).tolist()
        pois = [k for k, site in enumerate(route) if site in instance.pois]
        value += process_of(instance.failure).route_value(RouteProfile(
            incentives=tuple(float(vehicle.incentives[route[k]]) for k in pois),
            arrival_s=tuple(until[k] for k in pois), home_s=until[-1] if route else 0.0), vehicle.reliability)
    return value


def check_kept(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    plan = random_plan(ground, seed)
    want = closed_form(instance, plan)
    for news in NEWS:
        assert Reactions(ground, news, lambda *_: {}).of_plan(plan) == pytest.approx(want, rel=EXACT, abs=EXACT)
        team = team_of(instance, plan, keep(instance), news)
        played = [(history.weight, value_of(outcome)) for history, _, outcome in all_histories(team, instance)]
        assert sum(weight for weight, _ in played) == pytest.approx(1, rel=EXACT, abs=EXACT)
        assert sum(weight * value for weight, value in played) == pytest.approx(want, rel=EXACT, abs=EXACT)


@over_processes
@pytest.mark.parametrize("seed", range(60))
def test_a_plan_that_is_kept_earns_the_closed_form_whatever_the_news(seed: int, process: FailureProcess) -> None:
    check_kept(seed, process)


@pytest.mark.long
@over_processes
@pytest.mark.parametrize("seed", range(1000, 2000))
def test_a_plan_that_is_kept_earns_the_closed_form_on_many_teams(seed: int, process: FailureProcess) -> None:
    check_kept(seed, process)


def check_enumerated(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    for news in news_of(process, plan):
        seen: set[tuple[tuple[Here, ...], int]] = set()

        def answer(robots: list[Here], free: int, news: News = news,
                   seen: set[tuple[tuple[Here, ...], int]] = seen) -> dict[int, tuple[int, ...]]:
            seen.add((shown(robots, process, news), free))
            return enumerated(ground)(robots, free)

        want = Reactions(ground, news, answer).of_plan(plan)
        policy = Enumerated(ground)
        heard = Heard(policy)
        assert expected(instance, plan, heard, news) == pytest.approx(want, rel=EXACT, abs=EXACT)
        # What a policy is shown follows from what is known: hidden failures make no difference to it.
        assert {(shown(policy.reached(s), process, news), policy.free(s)) for s in heard.states} == seen


def shown(robots: list[Here], process: FailureProcess, news: News) -> tuple[Here, ...]:
    """Robots as they are compared: without rounding, and without orders that a moment ago were others, where several
    robots may fail between two events, one after the other."""
    several = process == "hazard" and news == "instant"
    return tuple(robot._replace(alive=round(robot.alive, 9), orders=() if several else robot.orders)
                 for robot in robots)


@pytest.mark.spread(80)
@over_processes
@pytest.mark.parametrize("seed", range(100))
def test_a_team_that_plans_again_earns_what_the_dynamic_program_says(seed: int, process: FailureProcess) -> None:
    check_enumerated(seed, process)


@pytest.mark.long
@over_processes
@pytest.mark.parametrize("seed", range(1000, 2000))
def test_teams_that_plan_again_earn_what_the_dynamic_program_says(seed: int, process: FailureProcess) -> None:
    check_enumerated(seed, process)


def check_order(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    if not is_small(ground):
        return
    reached = {news: Reactions(ground, news) for news in CENTRAL}
    of_plan = {news: reached[news].of_plan(plan) for news in CENTRAL}
    slack = 1e-9 * max(1.0, abs(of_plan["report"]))
    for news in news_of(process, plan):
        # Who learns at stations knows no more than a team that hears reports; who never learns, nothing.
        most = of_plan["instant" if news == "instant" else "report"]
        for policy in (keep(instance), Enumerated(ground)):
            assert expected(instance, plan, policy, news) <= most + slack
    foresight = clairvoyant(ground)
    for news in CENTRAL:
        assert of_plan[news] <= reached[news].best() + slack
        assert reached[news].best() <= foresight + slack


@pytest.mark.spread(25)
@over_processes
@pytest.mark.parametrize("seed", range(40))
def test_no_policy_beats_the_best_and_the_best_does_not_beat_foresight(seed: int, process: FailureProcess) -> None:
    check_order(seed, process)


@pytest.mark.long
@over_processes
@pytest.mark.parametrize("seed", range(1000, 1400))
def test_no_policy_beats_the_best_and_the_best_not_foresight_on_many_teams(seed: int, process: FailureProcess) -> None:
    check_order(seed, process)


def fates_of(history: Kept, outcome: TeamOutcome, process: FailureProcess, share: float) -> list[RobotFate]:
    """Fates that belong to a history: lifetimes end after a share of the time within which it says they do."""
    fates = []
    for robot, own in enumerate(outcome.robots):
        since, until = history.windows.get(robot, (math.inf, math.inf))
        before = 0 if robot in history.stays else NEVER
        if process == "per_leg" and own.end == "failed":
            before = own.pois_reached + 1
        fates.append(RobotFate(before, since if since == until else since + share * (until - since)))
    return fates


def check_drawn(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    for news in news_of(process, plan):
        team = team_of(instance, plan, Enumerated(ground), news)
        for _, history, outcome in all_histories(team, instance):
            for share in (0.02, 0.6, 0.99) if process == "hazard" else (0.0,):
                drawn = play(team, Drawn(fates_of(history, outcome, process, share)), legs_of(instance))
                assert drawn.stops == outcome.stops
                assert drawn.doubled == outcome.doubled
                for own, other in zip(drawn.robots, outcome.robots, strict=True):
                    assert own.end == other.end
                    assert (own.value, own.lost, own.pois_reached) == (other.value, other.lost, other.pois_reached)
                    # When a lifetime ends is a mean in a history, and everything else is the same to the second.
                    if process != "hazard" or own.end != "failed":
                        assert own.events == other.events
                    assert [(e.kind, e.site) for e in own.events] == [(e.kind, e.site) for e in other.events]


@over_processes
@pytest.mark.parametrize("seed", range(40))
def test_fates_drawn_ahead_come_to_the_same_as_the_history_that_they_belong_to(
        seed: int, process: FailureProcess) -> None:
    check_drawn(seed, process)


@pytest.mark.long
@over_processes
@pytest.mark.parametrize("seed", range(1000, 1500))
def test_fates_drawn_ahead_come_to_the_same_as_their_histories_on_many_teams(
        seed: int, process: FailureProcess) -> None:
    check_drawn(seed, process)


def check_resolve(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process, losses=True)
    for news in NEWS:
        heard = Heard(resolve(instance))
        team = team_of(instance, plan, heard, news)
        value = 0.0
        for history, _, outcome in all_histories(team, instance):
            value += history.weight * value_of(outcome)
            check_orders(outcome, instance, news)
        if news in CENTRAL and is_small(ground):
            assert value <= Reactions(ground, news).of_plan(plan) + 1e-6 * max(1.0, value)
        for state in dict.fromkeys(heard.states):
            check_answer(state, heard, ground)


def check_orders(outcome: TeamOutcome, instance: Instance, news: News) -> None:
    """Orders end at the base, the dead get none, and no POI is visited twice."""
    dead: set[str] = set()
    for reaction in outcome.reactions:
        dead |= set(reaction.failed)
        assert not dead & set(reaction.learned)
        assert set(reaction.before) == set(reaction.after) <= set(reaction.learned)
        for robot, orders in reaction.after.items():
            assert orders[-1:] in ((), (instance.sites[instance.base],))
            assert reaction.before[robot] != orders
    if news != "station":
        assert outcome.doubled == 0
    for vehicle, stops, own in zip(instance.vehicles, outcome.stops, outcome.robots, strict=True):
        assert own.end in ("home", "failed")  # nobody is late or runs dry without noise
        assert own.end == "home" or vehicle.name in dead or news in ("never", "station")
        assert all(here != there for here, there in pairwise(stops))


def check_answer(state: TeamState, heard: Heard, ground: Ground) -> None:
    """The orders are the best by enumeration, so no worse than to keep them, and the time makes no difference."""
    given = heard.policy(state)
    robots = Enumerated(ground)
    here = robots.reached(state)
    names, sites = [v.name for v in ground.instance.vehicles], list(ground.instance.sites)
    old = {names.index(r.robot): tuple(sites.index(s) for s in r.remaining) for r in state.robots}
    new = {**old, **{names.index(name): tuple(sites.index(s) for s in own) for name, own in given.items()}}
    value = sum(ground.of_orders(robot, new[robot.robot]) for robot in here)
    assert value == pytest.approx(ground.best_of_rest(here, robots.free(state))[0], rel=SOLVED, abs=SOLVED)
    assert value >= sum(ground.of_orders(robot, old[robot.robot]) for robot in here) - 1e-6
    later = replace(state, time_s=state.time_s + 1000)
    assert heard.policy(later) == given == resolve(ground.instance)(later)


@pytest.mark.spread(30)
@over_solved
@pytest.mark.parametrize("seed", range(40))
def test_orders_after_news_are_the_best_of_the_rest(seed: int, process: FailureProcess) -> None:
    check_resolve(seed, process)


@pytest.mark.parametrize("seed", [1227, 1354])
def test_lifetimes_by_an_availability_are_those_of_the_whole_limit(seed: int) -> None:
    # What is left of it was taken once, and robots planned for shorter lifetimes than theirs.
    check_resolve(seed, "hazard")


@pytest.mark.long
@over_solved
@pytest.mark.parametrize("seed", range(1000, 1500))
def test_orders_after_news_are_the_best_of_the_rest_on_many_teams(seed: int, process: FailureProcess) -> None:
    check_resolve(seed, process)


def check_asked(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    for news in NEWS:
        asked: list[Rest] = []

        def answer(rest: Rest, asked: list[Rest] = asked) -> dict[str, tuple[str, ...] | None]:
            asked.append(rest)
            _, orders = ground.best_of_rest([here_of(ground, v) for v in rest.vehicles], sum(
                ground.bit[instance.sites.index(p)] for p in rest.open_pois))
            return {instance.vehicles[k].name: tuple(instance.sites[j] for j in own) for k, own in orders.items()}

        heard = Heard(POLICIES["resolve"](Means(instance=instance, plans_rest=answer)))
        expected(instance, plan, heard, news)
        robots = Enumerated(ground)
        want = {(shown(robots.reached(state), process, "report"), robots.free(state)) for state in heard.states}
        assert {(shown([here_of(ground, v) for v in rest.vehicles], process, "report"), sum(
            ground.bit[instance.sites.index(p)] for p in rest.open_pois)) for rest in asked} == want


def here_of(ground: Ground, vehicle: Afield) -> Here:
    """A robot as the dynamic program has it."""
    sites, names = ground.instance.sites, [v.name for v in ground.instance.vehicles]
    return Here(names.index(vehicle.name), sites.index(vehicle.site), vehicle.ready_s, vehicle.burnt_s,
                vehicle.availability if ground.process == "mission" else 1.0,
                tuple(sites.index(site) for site in vehicle.orders))


@pytest.mark.spread(100)
@over_processes
@pytest.mark.parametrize("seed", range(150))
def test_the_rest_that_is_planned_leaves_out_what_others_claim_and_counts_on_what_is_known(
        seed: int, process: FailureProcess) -> None:
    check_asked(seed, process)


@pytest.mark.long
@over_processes
@pytest.mark.parametrize("seed", range(1000, 2000))
def test_the_rest_that_is_planned_leaves_out_what_others_claim_on_many_teams(
        seed: int, process: FailureProcess) -> None:
    check_asked(seed, process)


def check_foresight(seed: int) -> None:
    instance = random_team(seed, "mission")
    known = knowledge_of(instance)
    plans = plan_deterministic(instance, plan_stochastic(instance, known=known), known=known)
    plan = [tuple(instance.sites.index(site) for site in plans.plan.route(v.name)[1:]) for v in instance.vehicles]
    value = expected(instance, plan, resolve(instance), "instant")
    assert value == pytest.approx(clairvoyant(Ground(instance)), rel=SOLVED, abs=SOLVED)
    assert value == pytest.approx(wait_and_see(instance, known=known), rel=SOLVED, abs=SOLVED)


@pytest.mark.spread(10)
@pytest.mark.parametrize("seed", range(30))
def test_who_hears_of_whole_missions_before_anybody_leaves_earns_what_foresight_earns(seed: int) -> None:
    check_foresight(seed)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1000, 1300))
def test_who_hears_of_whole_missions_at_the_start_earns_what_foresight_earns_on_many_teams(seed: int) -> None:
    check_foresight(seed)


def told(outcome: TeamOutcome) -> tuple[object, ...]:
    """What happened, but for who heard of it."""
    return tuple(robot.events for robot in outcome.robots), outcome.stops


@over_processes
@pytest.mark.parametrize("seed", range(20))
def test_without_failures_news_and_policies_make_no_difference(seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    alive = Drawn([RobotFate()] * len(instance.vehicles))
    outcomes = [play(team_of(instance, plan, policy, news), alive, legs_of(instance)) for news in NEWS
                for policy in (keep(instance), Enumerated(ground), resolve(instance))]
    assert len({told(outcome) for outcome in outcomes}) == 1
    assert not any(outcome.reactions for outcome in outcomes)


@over_processes
@pytest.mark.parametrize("seed", range(20))
def test_news_make_no_difference_to_who_keeps_the_plan_nor_policies_to_who_hears_none(
        seed: int, process: FailureProcess) -> None:
    instance, ground, plan = setting(seed, process)
    rng = np.random.default_rng(seed)
    for _ in range(5):
        fates = Drawn([RobotFate(before_poi=0 if rng.random() < 0.3 and process == "mission" else NEVER)
                       if process == "mission" else RobotFate(int(rng.integers(1, 4))) if process == "per_leg"
                       else RobotFate(lifetime_s=float(rng.uniform(0, 30))) for _ in instance.vehicles])
        outcomes = [play(team_of(instance, plan, keep(instance), news), fates, legs_of(instance)) for news in NEWS]
        outcomes.append(play(team_of(instance, plan, Enumerated(ground), "never"), fates, legs_of(instance)))
        assert len({told(outcome) for outcome in outcomes}) == 1


def two_robots(process: FailureProcess, mtbf_s: float | None = None) -> tuple[Instance, Ground]:
    """Robot a is 2 s from p; b is 3 s from q; p and q are 4 s apart, and each is as far from home as it was away."""
    cost = np.array([[0, 2, 3], [2, 0, 4], [3, 4, 0]], dtype=float)
    instance = Instance(name="two", sites=("base", "p", "q"), base=0, stations=(), stop_s=np.zeros(3), failure=process,
                        vehicles=tuple(Vehicle(name=name, fuel_capacity_s=20, mission_limit_s=20, fuel_s=cost,
                                               incentives=np.array([0.0, 10, 20]), availability=s, mtbf_s=mtbf_s)
                                       for name, s in (("a", 1.0), ("b", 0.5))))
    return instance, Ground(instance)


@pytest.mark.parametrize(("news", "want"), [
    ("never", 20.0),  # 10 + 20 / 2
    ("instant", 30.0),  # b fails on leaving at 0 s, when a is on its way to p: it goes on to q
    ("report", 20.0),  # at 3 s a is on its way home, which is final
])
def test_two_robots_by_hand(news: News, want: float) -> None:
    instance, ground = two_robots("per_leg")
    plan = ((1, 0), (2, 0))
    assert Reactions(ground, news, enumerated(ground)).of_plan(plan) == want
    assert expected(instance, plan, Enumerated(ground), news) == want
    assert expected(instance, plan, resolve(instance), news) == want


def test_lifetimes_by_hand() -> None:
    # b reaches q with probability exp(-3/6). If it fails within the first 2 s, a is on its way to p yet and goes on to
    # q, and its own lifetime is endless; later than that, a is on its way home.
    instance, ground = two_robots("hazard", mtbf_s=6.0)
    instance = replace(instance, vehicles=(replace(instance.vehicles[0], mtbf_s=None), instance.vehicles[1]))
    ground = Ground(instance)
    plan = ((1, 0), (2, 0))
    want = 10 + 20 * math.exp(-3 / 6) + 20 * (1 - math.exp(-2 / 6))
    assert Reactions(ground, "instant", enumerated(ground)).of_plan(plan) == pytest.approx(want)
    assert expected(instance, plan, Enumerated(ground), "instant") == pytest.approx(want)


def test_random_teams_have_what_makes_teams_hard() -> None:
    # Else the sweeps above would be empty: robots that wait, reactions, several robots, correlation, losses.
    found = Counter[str]()
    for seed in range(60):
        instance, ground, plan = setting(seed, "per_leg")
        plan = random_plan(ground, seed)
        found["waits"] += any(not route for route in plan)
        found["three"] += len(plan) == 3
        found["stations"] += any(site in instance.stations for route in plan for site in route)
        found["joint"] += instance.joint is not None
        found["losses"] += any(v.loss_cost for v in instance.vehicles)
        found["small"] += is_small(ground)
        team = team_of(instance, plan, Enumerated(ground), "report")
        found["changes"] += any(r.after for _, _, outcome in all_histories(team, instance) for r in outcome.reactions)
    assert len(found) == 7
    assert min(found.values()) >= 8, found


@pytest.mark.parametrize("late_s", [0.0, 1.0, -1.0])
def test_a_policy_is_not_shown_how_late_a_robot_will_be_at_the_end_of_the_leg_that_it_is_on(late_s: float) -> None:
    # At 6 s a is on its way from p, where it was on time, to q, where it is due after 2 + 6 s.
    cost = np.array([[0, 2, 3, 6], [2, 0, 6, 9], [3, 6, 0, 9], [6, 9, 9, 0]], dtype=float)
    instance = Instance(name="late", sites=("base", "p", "q", "s"), base=0, stations=(), stop_s=np.zeros(4),
                        failure="per_leg", vehicles=tuple(Vehicle(
                            name=name, fuel_capacity_s=30, mission_limit_s=30, fuel_s=cost, availability=0.5,
                            incentives=np.array([0.0, 10, 20, 5])) for name in "ab"))
    heard = Heard(keep(instance))
    fates = Drawn([RobotFate(), RobotFate(before_poi=1)])
    team = team_of(instance, ((1, 2, 0), (3, 0)), heard, "report")

    def legs(robot: int, stops: tuple[str, ...]) -> LegDriven:
        planned = legs_of(instance)(robot, stops)
        return planned._replace(time_s=planned.time_s + (late_s if stops[-1] == "q" else 0.0))

    play(team, fates, legs)
    (state,) = heard.states
    seen = state.robots[0]
    assert (state.time_s, seen.site, seen.ready_s, seen.burnt_s) == (6.0, "q", 8.0, 8.0)
