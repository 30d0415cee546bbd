"""What a multi-robot mission plan is worth when robots fail, measured in physics.

From Python::

    import sva_bench as sb

    result = sb.run("worlds/four-rooms.yaml", trials=1000)
    result.summary.scenario("S3").vss.executed

Each name is loaded when it is first used, with what it needs.
"""

import sys

from sva_bench.environment import distrust_current_folder

if sys.argv[:1] == ["-m"]:  # as a program, before anything else is imported
    distrust_current_folder()

TYPE_CHECKING = False
if TYPE_CHECKING:
    from sva_bench.analysis.summaries import ComparisonSummary, Summary
    from sva_bench.errors import BadFile, BadInput, SvaBenchError, UnknownName
    from sva_bench.mission.certify import Certificate
    from sva_bench.mission.instance import Instance
    from sva_bench.mission.plan import Plan
    from sva_bench.study.given_plans import InfeasiblePlan
    from sva_bench.study.public.costs import fuel_costs, make_instance, travel_times
    from sva_bench.study.public.plans import certify, plan
    from sva_bench.study.public.results import Result
    from sva_bench.study.public.runs import execute, record, run
    from sva_bench.study.public.worlds import load_world
    from sva_bench.travel.berths import NoRoomForBerths, NoRoomForSlots
    from sva_bench.travel.fuel import FuelCosts
    from sva_bench.travel.times import NeverArrives, TravelTimes, UnreachableSite
    from sva_bench.workers.pool import WorkerLost
    from sva_bench.world.model import World

__version__: str
__all__ = [
    "BadFile", "BadInput", "Certificate", "ComparisonSummary", "FuelCosts", "InfeasiblePlan", "Instance",
    "NeverArrives", "NoRoomForBerths", "NoRoomForSlots", "Plan", "Result", "Summary", "SvaBenchError", "TravelTimes",
    "UnknownName", "UnreachableSite", "WorkerLost", "World", "certify", "execute", "fuel_costs", "load_world",
    "make_instance", "plan", "record", "run", "travel_times",
]
_HOMES = {
    "BadFile": "errors", "BadInput": "errors", "Certificate": "mission.certify",
    "ComparisonSummary": "analysis.summaries", "FuelCosts": "travel.fuel", "InfeasiblePlan": "study.given_plans",
    "Instance": "mission.instance", "NeverArrives": "travel.times", "NoRoomForBerths": "travel.berths",
    "NoRoomForSlots": "travel.berths", "Plan": "mission.plan",
    "Result": "study.public.results", "Summary": "analysis.summaries", "SvaBenchError": "errors",
    "TravelTimes": "travel.times", "UnknownName": "errors", "UnreachableSite": "travel.times",
    "WorkerLost": "workers.pool", "World": "world.model", "certify": "study.public.plans",
    "execute": "study.public.runs", "fuel_costs": "study.public.costs", "load_world": "study.public.worlds",
    "make_instance": "study.public.costs", "plan": "study.public.plans", "record": "study.public.runs",
    "run": "study.public.runs", "travel_times": "study.public.costs",
}
"""The module of each public name."""


def __getattr__(name: str) -> object:
    """What takes longer to find out or to load than Ctrl-C should have to wait: when it is asked for."""
    if name == "__version__":
        from importlib.metadata import version

        return version("sva-bench")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from sva_bench.study.libraries import EVERYTHING, load_libraries

    home = _HOMES[name]
    load_libraries((*EVERYTHING, home) if home == "study.public.runs" else (home,))
    found: object = getattr(sys.modules[f"sva_bench.{home}"], name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The public names, loaded or not, and no module or helper that happens to be here."""
    return sorted([*__all__, "__version__"])
