"""Sentences about unreachable POIs and infeasible plans, for terminal, page and check."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from sva_bench.analysis.results import GivenPlanResult
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, Reach

_NOTHING = "no robot reaches any POI: give them more fuel or time"
_NAMED = 20  # POIs or maps that a sentence names


def reached(
    missed: Mapping[str, Sequence[str]], robots: Sequence[str], pois: Sequence[str],
    earning: Mapping[str, Collection[str]] | None = None,
) -> Reach:
    """The section ``reach`` of ``summary.json``.

    Args:
        missed: POIs that each robot cannot visit and return from, by robot; robots that miss none may be left out.
        robots: All robots.
        pois: All POIs.
        earning: POIs at which each robot earns something, by robot; ``None`` = all. Nobody is missed at the others.
    """
    wanted = {robot: set(pois) if earning is None else set(earning.get(robot, ())) for robot in robots}
    told = {robot: tuple(poi for poi in missed.get(robot, ()) if poi in wanted[robot]) for robot in robots}
    return Reach(
        nothing=all(len(missed.get(robot, ())) == len(pois) for robot in robots),
        robots=tuple(robot for robot in robots if len(missed.get(robot, ())) == len(pois)),
        pois=tuple(poi for poi in pois if all(poi in missed.get(robot, ()) for robot in robots)
                   and any(poi in wanted[robot] for robot in robots)),
        missed={robot: found for robot, found in told.items() if found})


def why_nothing(reach: Reach) -> str:
    """Why no robot reaches any POI, where that is so, and what to change.

    Where none of those out of reach would earn anything, or there are none, more fuel is no help.
    """
    return _NOTHING if reach.missed else \
        "no POI earns a robot anything: add some under sites.pois, and give robots incentives there"


def beyond_reach(reach: Reach) -> list[str]:
    """A sentence for each robot that can't visit some POIs within its fuel and limit; none if no POI is reachable."""
    if reach.nothing:
        return []
    sentences = [f"{robot} reaches no POI within its fuel and limit, and stays home." if robot in reach.robots else
            f"{robot} {'reaches none of' if len(pois) > 1 else 'does not reach'} {_named(pois)} within its fuel and "
            "limit, and will never be sent there." for robot, pois in reach.missed.items()]
    if reach.pois:
        sentences.append(f"No robot reaches {_named(reach.pois)}.")
    return sentences


def unused_told(unused: Sequence[str], summary: AnySummary) -> list[str]:
    """A sentence about robots that no plan sends anywhere; of those that reach nothing another one says it."""
    names = [name for name in unused if name not in summary.reach.robots]
    if not names or summary.reach.nothing:
        return []
    left = f"{_named(names)} {'stays' if len(names) == 1 else 'stay'} home in every plan"
    return [left + ("; a team that reacts may send " + ("it." if len(names) == 1 else "them.") if any(
        scenario.reactions for scenario in summary.scenarios) else ".")]


def maps_without_reach(labels: Sequence[str]) -> list[str]:
    """A sentence about the maps of a batch on which no POI is reachable; a map may be listed for several seeds."""
    names = list(dict.fromkeys(labels))
    if not names:
        return []
    return [f"On {len(names)} map{'s' * (len(names) > 1)} ({_named(names)}) {_NOTHING}, or leave "
            f"{'it' if len(names) == 1 else 'them'} out."]


def lost_robots(plan: GivenPlanResult) -> str:
    """How many robot missions ended along the route, as ``500 of 2000``."""
    return f"{plan.lost} of {sum(plan.ends.values())}"


def warned(plan: GivenPlanResult) -> str:
    """The warning beside a plan in a ranking: that it is infeasible, and how many robot missions were lost."""
    words = ["infeasible"] * (not plan.feasible) + [f"{lost_robots(plan)} robot missions lost"] * bool(plan.lost)
    return f" ({', '.join(words)})" if words else ""


def infeasible_plans(summary: ComparisonSummary) -> list[str]:
    """A sentence about the plans that exceed fuel or limit; none if all are feasible."""
    names = list(dict.fromkeys(name for scenario in summary.scenarios for name, plan in scenario.plans.items()
                               if not plan.feasible))
    if not names:
        return []
    return [f"{_named(names)} {'is' if len(names) == 1 else 'are'} infeasible: fuel or mission limit would be broken. "
            f"{'It was' if len(names) == 1 else 'They were'} driven all the same; expected is what the routes would be "
            "worth if fuel and limit allowed them."]


def _named(names: Sequence[str]) -> str:
    words = [*names[:_NAMED], *([f"{len(names) - _NAMED} more"] if len(names) > _NAMED else [])]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
