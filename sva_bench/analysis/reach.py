"""What robots cannot reach, and plans that break their limits, in words: the same for terminal, page and check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

NOTHING = "no robot reaches any POI: give them more fuel or time"
_NAMED = 20  # POIs or maps that a sentence names


def reached(missed: Mapping[str, Sequence[str]], robots: Sequence[str], pois: Sequence[str]) -> dict[str, Any]:
    """What ``summary.json`` says of reach.

    Args:
        missed: POIs that each robot cannot visit and come home from, by robot; those that miss none may be left out.
        robots: All robots.
        pois: All POIs.
    """
    return {
        "nothing": all(len(missed.get(robot, ())) == len(pois) for robot in robots),
        "robots": [robot for robot in robots if len(missed.get(robot, ())) == len(pois)],
        "pois": [poi for poi in pois if all(poi in missed.get(robot, ()) for robot in robots)],
        "missed": {robot: list(missed[robot]) for robot in robots if missed.get(robot)},
    }


def nothing_reached(summary: Mapping[str, Any]) -> bool:
    """Whether no robot reaches any POI; summaries written before this was asked don't say."""
    return bool(summary.get("reach", {}).get("nothing", False))


def beyond_reach(summary: Mapping[str, Any]) -> list[str]:
    """A sentence for each robot that can't visit some POIs within its fuel and limit; none where nothing is reached."""
    reach = summary.get("reach", {})
    if reach.get("nothing", False):
        return []
    said = [f"{robot} reaches no POI within its fuel and limit, and stays home." if robot in reach["robots"] else
            f"{robot} reaches none of {_named(pois)} within its fuel and limit, and will never be sent there."
            for robot, pois in reach.get("missed", {}).items()]
    if reach.get("pois"):
        said.append(f"No robot reaches {_named(reach['pois'])}.")
    return said


def maps_without_reach(units: Sequence[Mapping[str, Any]]) -> list[str]:
    """What to say of the maps of a batch on which nothing can be collected."""
    names = list(dict.fromkeys(f"{unit['world']} ({unit['variant']})" if unit["variant"] else str(unit["world"])
                               for unit in units if nothing_reached(unit)))
    if not names:
        return []
    return [f"On {len(names)} map{'s' * (len(names) > 1)} ({_named(names)}) {NOTHING}, or leave "
            f"{'it' if len(names) == 1 else 'them'} out."]


def infeasible(plan: Mapping[str, Any]) -> bool:
    """Whether a plan breaks fuel or limit and is driven all the same; plans of ``run`` never do."""
    return not plan.get("feasible", True)


def lost_robots(plan: Mapping[str, Any]) -> str:
    """``500 of 2000``: how many robot missions ended along the route."""
    return f"{plan['lost']} of {sum(plan['ends'].values())}" if "lost" in plan else ""


def warned(plan: Mapping[str, Any]) -> str:
    """What a ranking says of a plan before its figure: that it is infeasible, and how many robots were lost."""
    words = ["infeasible"] * infeasible(plan) + [f"{lost_robots(plan)} robot missions lost"] * bool(plan.get("lost"))
    return f" ({', '.join(words)})" if words else ""


def infeasible_plans(summary: Mapping[str, Any]) -> list[str]:
    """A sentence about the plans that break fuel or limit."""
    names = list(dict.fromkeys(name for scenario in summary["scenarios"] for name, plan in scenario["plans"].items()
                               if infeasible(plan)))
    if not names:
        return []
    return [f"{_named(names)} {'is' if len(names) == 1 else 'are'} infeasible: fuel or mission limit would be broken. "
            f"{'It was' if len(names) == 1 else 'They were'} driven all the same; expected is what the routes would be "
            "worth if fuel and limit allowed them."]


def _named(names: Sequence[str]) -> str:
    words = [*names[:_NAMED], *([f"{len(names) - _NAMED} more"] if len(names) > _NAMED else [])]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
