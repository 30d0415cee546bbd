"""One trial or history of a finished run again, recorded."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.choices import News, PolicyName, RecordedKind
from sva_bench.errors import BadInput, nearest
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.outcome import Trace
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.react import react_again
from sva_bench.execution.reacted import Reacted
from sva_bench.execution.team_outcome import Reaction
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.mission.plan_file import read_plan
from sva_bench.solver.rest import plan_rest
from sva_bench.storage.outcome_table import outcome_table
from sva_bench.storage.run_folder import made_for, recording_stem, stem_of
from sva_bench.storage.stored_run import Content, find_row, read_content, run_folder_at
from sva_bench.storage.trial_choice import TrialChoice, trial_of
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.given_plans import without_times
from sva_bench.study.recording_files import about_of, record_team, record_trial
from sva_bench.study.recordings import Recorded
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress


@dataclass(frozen=True, eq=False, kw_only=True)
class Wanted:
    """What is to be seen again.

    Attributes:
        scenario: The scenario; ``None`` = the only one.
        trial: Number of the trial, or of the history; of no matter where ``kind`` says otherwise.
        planner: Whose plan; ``None`` = everybody's.
        policy, news: The reaction; ``None`` = the only one of the run that fits.
        kind: How the trial is chosen: each plan has a worst one of its own.
    """

    scenario: str | None
    trial: int = 0
    planner: str | None = None
    policy: PolicyName = "none"
    news: News | None = None
    kind: RecordedKind = "trial"


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """A trial of a run that can be played again.

    Attributes:
        case: Plan, scenario, policy and news.
        trial: Number of the trial, or of the history.
        history: Noise draw and history, where these are enumerated.
    """

    case: Case
    trial: int
    history: tuple[int, int] | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Replayed:
    """A trial again.

    Attributes:
        case: Plan, scenario, policy and news.
        rows: Its rows as in ``outcomes.parquet``.
        recording: Where it was recorded; ``None``: nowhere.
        reactions: News that was heard, in order, and how orders changed.
        traces: The trial over time.
        news: What was heard, with the paths that orders change.
    """

    case: Case
    rows: Sequence[Mapping[str, Any]]
    recording: Path | None
    reactions: Sequence[Reaction] = ()
    traces: Sequence[Trace] = ()
    news: Sequence[NewsHeard] = ()

    def reactions_as_dicts(self) -> list[dict[str, Any]]:
        """The reactions as ``--json`` prints them."""
        case = self.case
        return [{"scenario": case.scenario.name, "planner": case.planner, "policy": case.policy, "news": case.news,
                 "time_s": heard.time_s, "failed": list(heard.failed), "learned": list(heard.learned),
                 "orders": {robot: {"since": heard.since[robot], "before": list(heard.before[robot]),
                                    "after": list(new)} for robot, new in heard.after.items()}}
                for heard in self.reactions]

    def told(self) -> list[str]:
        """What was heard when, and whose orders changed to what, in plain lines."""
        lines, known = [], set[str]()
        for heard in self.reactions:
            known |= set(heard.failed)
            gone = [robot for robot in heard.learned if self._gone(robot, heard.time_s)]
            learned = ", ".join(robot for robot in heard.learned if robot not in gone) or "nobody"
            changed = "" if heard.after else "; no orders changed" if heard.learned else \
                self._beyond(known, heard.time_s)
            lines.append(f"at {heard.time_s:.1f} s {learned} learned that {', '.join(heard.failed)} failed{changed}")
            lines += [f"  {self._as_it_is(robot, heard.time_s)} was told, and hears nothing" for robot in gone]
            lines += [f"  {self._as_it_is(robot, heard.time_s)}, from {heard.since[robot]}: "
                      f"{_stops(heard.before[robot])}; now {_stops(new)}" for robot, new in heard.after.items()]
        if self.case.policy != "none" and not lines:
            lines.append("nothing was heard of any failure")
        return lines

    def _as_it_is(self, robot: str, time_s: float) -> str:
        """A robot that is told something: whether it is lost by then, which the team doesn't know yet."""
        end = self._gone(robot, time_s)
        return f"{robot} ({end}, unknown to the team)" if end else robot

    def _gone(self, robot: str, time_s: float) -> str:
        """How a robot's mission had ended by then, if it was lost; else nothing."""
        row = next(row for row in self.rows if row["robot"] == robot)
        lost = row["lost"] or row["end"] in ("failed", "out_of_fuel", "stuck")
        return str(row["end"]).replace("_", " ") if lost and row["end_time_s"] <= time_s else ""

    def _beyond(self, known: Container[str], time_s: float) -> str:
        """Why nobody could be told: all robots but those known to be dead are home, or on their last leg there."""
        where = [f"{self._as_it_is(row['robot'], time_s)} is "
                 + ("home" if row["end"] in ("home", "late") and row["end_time_s"] <= time_s else "on its way home")
                 for row in self.rows if row["robot"] not in known]
        return f"; nobody could be told: {', '.join(where) or 'no robot is left'}"


def _stops(orders: Sequence[str]) -> str:
    return " → ".join(orders) or "no orders"


def replay(folder: Path, wanted: Wanted, executor: Executor | None, progress: OnProgress) -> list[Replayed]:
    """Play one trial of a run again, for each plan asked for, and record it into the run's folder.

    Raises:
        BadInput: If this is no run folder, or the run has no such trial.
        BadFile: If a file of the folder is damaged.
    """
    content = read_content(run_folder_at(folder))
    cases = cases_of(folder, content, wanted)
    costs = plan_costs(content.world, content.manifest.options["planner"], progress)
    foreign = isinstance(content.summary, ComparisonSummary)
    found = []
    for one in cases:
        which = TrialChoice(kind=wanted.kind, trial=one.trial).in_names
        path = folder / "recordings" / f"{recording_stem(one.case.key, which, foreign=foreign)}.rrd"
        path.parent.mkdir(exist_ok=True)
        found.append(play_again(content, costs, one, path, executor, wanted.kind))
    return found


def play_again(
    content: Content, costs: Mapping[str, FuelCosts], one: Found, path: Path | None, executor: Executor | None,
    kind: RecordedKind = "trial",
) -> Replayed:
    """Play one trial of one case again.

    Args:
        content, costs: The run, and the fuel costs of its world.
        one: The trial.
        path: Where it is recorded; ``None``: nowhere.
        executor: Processes that drive.
        kind: How it was chosen.
    """
    case, trial = one.case, one.trial
    world, summary = content.world, content.summary
    settings = Settings(seed=summary.seed, trials=summary.trials, rollouts=summary.rollouts, fidelity=summary.fidelity)
    run: Executed | Reacted
    reactions: Sequence[Reaction] = ()
    news: Sequence[NewsHeard] = ()
    if case.policy == "none":
        settings = replace(settings, first=trial, trials=1)
        (run,) = execute(world, costs, [case], settings, executor)
        traces = run.traces
        if path is not None:
            recorded = Recorded(case=case, trial=trial, kind=kind, traces=run.traces)
            record_trial(path, world, case, run.traces, about_of(recorded, settings))
    else:
        instance = replace(instance_of(world, costs, case.scenario), failure=world.execute_failure)
        policy = POLICIES[case.policy](Means(instance=instance, plans_rest=plan_rest))
        run = react_again(world, costs, case, policy, settings, trial, one.history, executor)
        assert run.shown is not None, "a mission that is played again is shown"
        traces, news = run.shown.traces, run.shown.news
        if path is not None:
            record_team(path, world, case, run.shown, settings, kind)
        reactions = run.played[0].reactions
    table = outcome_table(run, [robot.name for robot in world.robots], settings)
    return Replayed(case=case, rows=table.to_pylist(), recording=path, reactions=reactions, traces=traces,
                    news=news)


def cases_of(folder: Path, content: Content, wanted: Wanted) -> list[Found]:
    """The plans that are to be played again, each in its trial.

    Raises:
        BadInput: If the run has no such plan, reaction or trial.
    """
    scenarios: Sequence[ScenarioSummary | ComparedScenario] = content.summary.scenarios
    names = [scenario.name for scenario in scenarios]
    number = names.index(_one_of("--scenario", wanted.scenario, names))
    told, scenario, instance = scenarios[number], content.world.scenarios[number], without_times(content.world)
    plans: Sequence[str] = list(told.plans)
    news: News = "never"
    reactions = told.reactions or ()
    if wanted.policy != "none":
        mine = {r.news: r for r in reactions if r.policy == wanted.policy}
        if not mine:
            raise BadInput(f"--policy {wanted.policy}: the run measured no such reaction; run its command again with "
                           f"--policy {wanted.policy}")
        if wanted.news is not None and wanted.news not in mine:
            raise BadInput(f"--news {wanted.news}: not measured with {wanted.policy}; " + (
                "to see the trial without a reaction, leave out --policy; " if wanted.news == "never" else "")
                + f"the run has {', '.join(mine)}")
        news = {str(when): when for when in mine}[_one_of("--news", wanted.news, list(mine))]
        plans = list(mine[news].plans)
    elif wanted.news not in (None, "never"):
        raise BadInput(f"--news {wanted.news}: nobody reacts to it without a policy; add --policy resolve")
    if wanted.planner is None:
        plans = [name for name in plans if name != "informed"]
    elif wanted.planner not in plans and (others := dict.fromkeys(
            r.policy for r in reactions if wanted.planner in r.plans)):
        raise BadInput(f"--planner {wanted.planner}: this plan was made for a reaction; add --policy "
                       f"{next(iter(others))}")
    elif _one_of("--planner", wanted.planner, list(plans)) == "informed":
        raise BadInput("--planner informed: it has another plan for each set of robots; replay one of the others")
    cases = []
    for name in plans if wanted.planner is None else [wanted.planner]:
        key = scenario.name, name, wanted.policy, news
        choice = TrialChoice(kind=wanted.kind, trial=wanted.trial)
        trial = trial_of(folder, choice, key, content.manifest.recordings)
        row = find_row(folder / "outcomes.parquet", key, trial)
        assert row is not None, "a trial that was found has rows"
        kept = name if (scenario.name, name) in content.stems else made_for(name, news)
        foreign = isinstance(content.summary, ComparisonSummary)
        plan = read_plan(folder / "plans" / f"{stem_of(scenario.name, kept, foreign=foreign)}.json", instance)
        case = Case(scenario=scenario, planner=name, plan=plan, policy=wanted.policy, news=news)
        cases.append(Found(case=case, trial=trial, history=row if row[1] >= 0 else None))
    return cases


def _one_of(option: str, value: str | None, known: Sequence[str]) -> str:
    """The value of an option, or the only one there is.

    Raises:
        BadInput: If there is no such, or it isn't given and there are several.
    """
    if value is None and len(known) == 1:
        return known[0]
    if value is None:
        raise BadInput(f"{option}: the run has several; name one of {', '.join(known)}")
    if value not in known:
        raise BadInput(f"{option} {value[:60]!r}: the run has none of that name; {nearest(value, list(known))}")
    return value
