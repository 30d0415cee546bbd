"""Which trials of a run are recorded, and these trials over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.choices import RECORDED_WORDS, RecordedKind
from sva_bench.errors import BadInput, nearest
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.outcome import Trace
from sva_bench.files.printable import shown
from sva_bench.storage.trial_choice import nearest_to_median
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

_EXPECTED = "expected a trial's number, typical, median or worst, or one of these after a scenario, as in S3:17"


@dataclass(frozen=True, kw_only=True)
class Ask:
    """A recording that is asked for.

    Attributes:
        kind: How its trial is chosen.
        scenario: Of which scenario; ``None`` = of each.
        trial: The trial's number, where it is chosen by that.
    """

    kind: RecordedKind
    scenario: str | None = None
    trial: int | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Recorded:
    """A trial of one plan over time.

    Attributes:
        case: Plan and scenario.
        trial: Its number.
        kind: How it was chosen.
        traces: A trace for each robot.
    """

    case: Case
    trial: int
    kind: RecordedKind
    traces: tuple[Trace, ...]


def asks_of(words: Sequence[str], scenarios: Sequence[str], trials: int) -> tuple[Ask, ...]:
    """Recordings of an option such as ``S3:17,worst``, in the order given.

    Args:
        words: Its values, each an entry or several with commas between them.
        scenarios: Names of the scenarios.
        trials: How many trials there are.

    Raises:
        BadInput: If an entry is none, or there is no such scenario or trial, or it is given twice.
    """
    found: list[Ask] = []
    for part in ",".join(words).split(",") if words else ():
        entry = part.strip()
        scenario, colon, which = entry.rpartition(":")
        if not which or (colon and not scenario):
            raise BadInput(f"--record {shown(entry or ','.join(words))}: {_EXPECTED}")
        if colon and scenario not in scenarios:
            raise BadInput(f"--record {shown(entry)}: there is no scenario {shown(scenario)}; "
                           f"{nearest(scenario, list(scenarios))}")
        ask = _ask(entry, scenario or None, which, trials)
        if ask in found:
            raise BadInput(f"--record {shown(entry)}: given twice; give it once")
        found.append(ask)
    return tuple(found)


def _ask(entry: str, scenario: str | None, which: str, trials: int) -> Ask:
    by_name: dict[str, RecordedKind] = {"typical": "typical", "median": "median", "worst": "worst"}
    assert by_name.keys() == RECORDED_WORDS.keys()
    if which in by_name:
        return Ask(kind=by_name[which], scenario=scenario)
    if not (which.isascii() and which.isdigit()):
        raise BadInput(f"--record {shown(entry)}: {_EXPECTED}")
    if len(which) > 12 or int(which) >= trials:
        raise BadInput(f"--record {shown(entry)}: there is no such trial; the first is 0, the last {trials - 1}")
    return Ask(kind="trial", scenario=scenario, trial=int(which))


def typical_trial(runs: Sequence[Executed]) -> int:
    """The typical trial of a scenario, the same for all its plans, so that they are seen under the same failures.

    Of the trials in which robots end as they most often do, under all plans together, that with the median of what the
    plans collect; of several alike one of the first noise draw, whose drives are traced already, and then the first.

    Args:
        runs: The plans' trials, in the same order.
    """
    ends = np.column_stack([run.end for run in runs])
    _, course, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    course = course.reshape(-1)
    most = np.flatnonzero(counts[course] == counts.max())
    alike = np.flatnonzero(course == course[most[0]])
    value = np.sum([run.value.sum(axis=1) for run in runs], axis=0)[alike]
    near = alike[nearest_to_median(value)]
    first_draw = near[runs[0].rollout[near] == 0]
    return int((first_draw if len(first_draw) else near)[0])


def _chosen(run: Executed, ask: Ask, typical: int) -> int:
    value = run.value.sum(axis=1)
    match ask.kind:
        case "worst":
            return int(value.argmin())
        case "median":
            return int(nearest_to_median(value)[0])
        case "trial" if ask.trial is not None:
            return ask.trial
        case _:
            return typical


def recorded_trials(
    world: World, costs: Mapping[str, FuelCosts], executed: Sequence[Executed], asks: Sequence[Ask],
    settings: Settings, executor: Executor | None, drives: Drives,
) -> list[Recorded]:
    """A typical trial of every plan, and those that are asked for, over time.

    Args:
        world, costs, settings: As the plans were executed.
        executed: What came of the plans.
        asks: Recordings beside the typical ones.
        executor: Where drives run; ``None`` = here.
        drives: What was driven already.
    """
    wanted: list[tuple[Executed, int, RecordedKind]] = []
    for scenario in dict.fromkeys(run.case.scenario.name for run in executed):
        runs = [run for run in executed if run.case.scenario.name == scenario]
        shown_runs = [run for run in runs if run.case.role != "informed"]
        typical = typical_trial(shown_runs)
        for run in runs:
            if run.case.role == "informed":  # another plan in each trial: that of the first was kept
                wanted.append((run, 0, "first"))
                continue
            wanted.append((run, typical, "typical"))
            taken = {("typical", typical)}
            for ask in asks:
                if ask.scenario in (None, scenario) and ask.kind != "typical":
                    trial = _chosen(run, ask, typical)
                    if (ask.kind, trial) not in taken:
                        taken.add((ask.kind, trial))
                        wanted.append((run, trial, ask.kind))
    traced = _traced(world, costs, wanted, settings, executor, drives)
    return [Recorded(case=run.case, trial=trial, kind=kind, traces=traced[run.case.key, trial])
            for run, trial, kind in wanted]


def _traced(
    world: World, costs: Mapping[str, FuelCosts], wanted: Sequence[tuple[Executed, int, RecordedKind]],
    settings: Settings, executor: Executor | None, drives: Drives,
) -> dict[tuple[object, int], tuple[Trace, ...]]:
    """The trials over time, by case and number; the first trials are so already, the rest is driven again."""
    traced: dict[tuple[object, int], tuple[Trace, ...]] = {
        (run.case.key, 0): run.traces for run, trial, _ in wanted if trial == 0}
    again: dict[int, dict[object, Case]] = {}
    for run, trial, _ in wanted:
        if trial:
            again.setdefault(trial, {})[run.case.key] = run.case
    for trial, cases in again.items():
        # Whole routes that are known already may have no poses.
        known = Drives(hops=drives.hops, missions=drives.missions)
        for run in execute(world, costs, list(cases.values()), replace(settings, first=trial, trials=1), executor,
                           None, known):
            traced[run.case.key, trial] = run.traces
    return traced
