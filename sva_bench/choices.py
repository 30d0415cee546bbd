"""Every word that users choose from or read in results, once: options, files, signatures and registries share them.

Nothing is imported here, so that ``--help`` need not load the modules that the words are about.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

# Inputs
SiteKind = Literal["base", "station", "poi"]
FailureProcess = Literal["mission", "per_leg", "hazard"]
FAILURES: Mapping[FailureProcess, str] = {
    "mission": "one draw for each robot and mission: a robot that fails never leaves",
    "per_leg": "a draw before each next point: a robot that fails there keeps what it has",
    "hazard": "each robot fails after a time of driving that is drawn: what it has by then it keeps",
}
"""How robots fail, in a few words each."""
MapMode = Literal["trinary", "scale", "raw"]
Interaction = Literal["independent", "uncoordinated", "shared"]
INTERACTIONS: Mapping[Interaction, str] = {
    "independent": "robots do not meet: each drives as if it were alone",
    "uncoordinated": "they drive in one world, nobody coordinates them, and a collision of two ends both",
    "shared": "they drive in one world, coordinated: they wait for each other and never touch",
}
"""What robots are to each other, in a few words each."""
Departures = Literal["together", "staggered"]
DEPARTURES: Mapping[Departures, str] = {
    "together": "all robots leave their berths at once",
    "staggered": "a robot leaves later by what it would wait for others on its first leg",
}
"""When robots that share a world leave, in a few words each."""
Unknown = Literal["occupied", "free"]
"""What cells of a map count as that are neither occupied nor free."""
SolidKind = Literal["box", "cylinder", "sphere"]
"""The shapes that a robot's own body may be of."""
WorldFamily = Literal["rooms", "field", "aisles", "maze"]
InstanceFamily = Literal["A", "B", "C"]

# Planning
PathPlanner = Literal["prmstar", "rrtconnect", "fmt", "bfmt", "informedrrtstar"]
Objective = Literal["stochastic", "deterministic"]
OwnPlan = Literal["stochastic", "deterministic", "calibrated"]
"""The plans of a scenario that are made for its own sake; the third on request."""
OWN_PLANS: tuple[OwnPlan, ...] = get_args(OwnPlan)
PlanObjective = Literal["stochastic", "deterministic", "cvar", "excess", "anticipative"]
"""What a plan was made for; ``cvar`` and ``excess`` are the stochastic objective with a risk, and ``anticipative`` is
the value with a reaction."""
RiskKind = Literal["cvar", "excess"]
Method = Literal["auto", "expected", "dep", "relaxed", "lshaped", "undirected", "edge-mip", "branch-and-price"]
METHODS: Mapping[Method, str] = {
    "auto": "chooses by the instance",
    "expected": "the collapsed model by branch and cut, a column for each leg",
    "dep": "the paper's deterministic equivalent",
    "relaxed": "that of dep with the recourse relaxed",
    "lshaped": "the paper's L-shaped method",
    "undirected": "the collapsed model with a column for each edge, for symmetric costs without refuelling",
    "edge-mip": "the model of undirected, by HiGHS's own branch and bound",
    "branch-and-price": "routes as columns",
}
"""How a plan is proved, in a few words each."""
Cuts = Literal["single", "multi", "pareto"]
Status = Literal["optimal", "feasible", "time_limit", "interrupted"]
"""Of a plan, best first."""

# Exports
ExportFormat = Literal["nav2", "geojson", "csv"]
EXPORT_FORMATS: Mapping[ExportFormat, str] = {
    "nav2": "waypoints (YAML) as RViz's Nav2 panel loads them",
    "geojson": "sites and planned paths, in metres in the map's frame",
    "csv": "columns robot, stop, site",
}
"""What plans are written as for other programs, in a few words each."""
TrialFormat = Literal["mcap"]
TRIAL_FORMATS: Mapping[TrialFormat, str] = {
    "mcap": "a trial of a run as a ROS 2 bag, with poses, paths, states and events",
}
"""What trials are written as for other programs, in a few words each."""
AnyFormat = Literal[ExportFormat, TrialFormat]

# Recordings
RecordedKind = Literal["typical", "median", "worst", "trial", "first"]
"""How a recorded trial was chosen; ``trial`` by its number, ``first`` where no other can be shown."""
RECORDED_WORDS: Mapping[str, str] = {
    "typical": "robots end as they most often do",
    "median": "of median value",
    "worst": "of least value",
}
"""What trials are recorded by name, in a few words each."""
RobotState = Literal["at the base", "driving", "waiting", "at a POI", "refuelling", "failed", "out of fuel", "stuck",
                     "home", "home late"]
"""What a recorded robot is doing."""
FilmMark = Literal["disc", "cross", "line", "dash", "square", "diamond"]
"""Shapes in the legend of a film."""

# Execution
Fidelity = Literal["kinematic", "rollout", "physics"]
EngineName = Literal["ideal", "bullet"]
PolicyName = Literal["none", "resolve"]
"""What a team does about news of a failure."""
POLICY_NAMES: tuple[PolicyName, ...] = get_args(PolicyName)
News = Literal["never", "station", "report", "instant"]
"""When a team learns of a failure, the worst informed first."""
NEWS: tuple[News, ...] = get_args(News)
HistoryMode = Literal["enumerated", "sampled"]
"""How the failures of a team that reacts are gone through: all histories, or a sample of trials."""
USUAL_NEWS: News = "report"
"""What a team that reacts hears where nothing else is asked for: a missing report needs no radio beyond a stop's."""
Standing = Literal["alive", "unheard", "dead", "home"]
"""What a team knows of a robot: ``unheard`` is one that has not reported from any stop yet."""
End = Literal["home", "failed", "out_of_fuel", "late", "stuck"]
ENDS: tuple[End, ...] = get_args(End)
Role = Literal["stochastic", "deterministic", "anticipative", "calibrated", "informed", "informed_part", "worst_tie",
               "given"]
"""What a plan is executed for: ours, the third made for a reaction and the fourth for calibrated costs; what is behind
the informed planner, and one of its plans; the least fortunate of the deterministic plans that tie; or given from
elsewhere."""
Best = Literal["best"]
"""What plans are calibrated for in place of a share of bad missions: the greatest executed value."""
EventKind = Literal["departed", "waits", "touches", "arrived", "collected", "refuelled", "failed", "out_of_fuel",
                    "late", "stuck", "home"]
HappeningKind = Literal["arrived", "ended", "stuck", "touch", "waits", "rest", "time", "idle", "deadlock"]
"""What a team that shares a world is stopped for."""
DriveUnit = Literal["hops", "routes", "missions"]
"""What is driven at a time: from site to site, from base to base, or all robots of a world together."""
Fault = Literal["tipped over", "physics failed"]
"""Why a robot drives no more though nothing holds it: it lies on its side, or physics gives no finite pose of it."""
MarkKind = Literal["contact", "collision", "wait"]
"""What a picture marks of what robots met: contacts with obstacles, collisions of two robots, and waits."""
StandKind = Literal["berth", "slot"]
"""A place for one robot, at the base or at a station."""
Judgement = Literal["safe", "close", "edge"]
"""Of a leg under noise: one with little margin is ``close``, one on which robots run dry or late is on the ``edge``."""
NoiseName = Literal["wheels", "speed", "track", "localisation", "delay", "payload", "capacity", "people", "passages",
                    "floors", "contact"]
"""What the execution meets that a plan doesn't know of, by the names under which its effects are reported."""
NOISE_NAMES: tuple[NoiseName, ...] = get_args(NoiseName)
MetName = Literal["waits", "detours", "collisions"]
"""What robots of one world do to each other, by the names under which its effects are reported."""
MET_NAMES: tuple[MetName, ...] = get_args(MetName)
SourceName = Literal[NoiseName, MetName, "interplay"]
"""What the ledger of sources is divided into: the noise, other robots, and what is due to no source by itself."""
NoisePreset = Literal["realistic"]
SampleOf = Literal["maps", "trials"]
"""What the intervals of a comparison are over: trials where there is one map only."""
