"""Whether a run folder holds what it claims: everything that can be worked out again is, and compared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from sva_bench import __version__
from sva_bench.analysis.results import PlanFigures
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.choices import News, PolicyName
from sva_bench.errors import BadFile
from sva_bench.files.printable import counted
from sva_bench.mission.certify import certify
from sva_bench.mission.instance_file import instance_text
from sva_bench.mission.plan_file import read_plan
from sva_bench.storage.agreement import Key
from sva_bench.storage.recount import Recount, recount
from sva_bench.storage.run_folder import travel_table
from sva_bench.storage.stored_run import Content, last_trial, read_content, rows_of_trial, run_folder_at
from sva_bench.storage.tables import TRAVEL_TIMES, pieces_of
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.planning import other_processes
from sva_bench.study.replay import Wanted, cases_of, play_again
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress

_SAME = 1e-9  # relative tolerance of figures worked out by the same formula
_SUMMED = 1e-6  # of means that are summed in another order


@dataclass(frozen=True, kw_only=True)
class Verified:
    """What was worked out again.

    Attributes:
        checked: What agrees, in the order in which it was looked at.
        difference: The first that doesn't; ``None``: all agrees.
    """

    checked: tuple[str, ...]
    difference: str | None

    def as_dict(self) -> dict[str, Any]:
        """The content of ``--json``."""
        return {"format": "sva-bench/verification@1", "holds": self.difference is None, "checked": list(self.checked),
                "difference": self.difference}


class _Differs(Exception):
    """Something in the folder isn't what it is when worked out again."""


def verify(folder: Path, sample: int, executor: Executor | None, progress: OnProgress) -> Verified:
    """Work out again what a run folder claims.

    Travel times and instances from the world; certificates of all plans, and their promised and expected values;
    means, ends, VSS and ledgers from the outcomes; and some trials of each plan and reaction, which are played again
    and compared row by row.

    Args:
        folder: The run folder.
        sample: How many trials of each plan and reaction are played again.
        executor: Processes that drive.
        progress: Told how far it is.

    Raises:
        BadInput: If this is no run folder.
    """
    checked: list[str] = []
    run_folder_at(folder)
    try:
        content = read_content(folder)
        checked.append("the folder's files are of one run")
        costs = plan_costs(content.world, content.manifest.options["planner"], progress)
        checked.append(_travel(folder, costs))
        checked.append(_instances(folder, content, costs))
        checked.append(_certificates(folder, content, costs))
        checked.append(_figures(folder, content))
        checked += _trials(folder, content, costs, sample, executor, progress)
    except (_Differs, BadFile) as error:
        ran_by = content.manifest.version if checked else __version__
        other = "" if ran_by == __version__ else f" (the run is of version {ran_by}, this is {__version__})"
        return Verified(checked=tuple(checked), difference=str(error) + other)
    return Verified(checked=tuple(checked), difference=None)


def _travel(folder: Path, costs: Mapping[str, FuelCosts]) -> str:
    table = travel_table(costs)
    found = pa.concat_tables([TRAVEL_TIMES.empty_table(), *(
        piece.cast(TRAVEL_TIMES) for piece in pieces_of(folder / "travel_times.parquet", TRAVEL_TIMES))])
    if found.num_rows != table.num_rows:
        raise _Differs(f"travel_times.parquet: {counted(found.num_rows, 'row')}, where the world gives "
                       f"{table.num_rows}")
    for there, here in zip(found.to_pylist(), table.to_pylist(), strict=True):
        if there != here:
            raise _Differs(f"travel_times.parquet: {there} stands there, and the world gives {here}")
    return counted(table.num_rows, "travel time")


def _instances(folder: Path, content: Content, costs: Mapping[str, FuelCosts]) -> str:
    others = other_processes(content.world, assumptions=bool(content.manifest.options.get("assumptions")))
    for scenario in content.world.scenarios:
        path = folder / f"instance-{scenario.name}.json"
        if not path.is_file():
            raise _Differs(f"{path.name} is missing")
        expected = instance_text(instance_of(content.world, costs, scenario, others)).encode()
        if path.stat().st_size != len(expected) or path.read_bytes() != expected:
            raise _Differs(f"{path.name}: not the instance that the world gives")
    return counted(len(content.world.scenarios), "instance")


def _certificates(folder: Path, content: Content, costs: Mapping[str, FuelCosts]) -> str:
    """Check that plans are feasible, and worth what is promised and expected of them."""
    count = 0
    for told, scenario in zip(content.summary.scenarios, content.world.scenarios, strict=True):
        instance = instance_of(content.world, costs, scenario)
        executed = replace(instance, failure=content.world.execute_failure)
        for name, figures in told.plans.items():
            if name == "informed":
                continue  # another plan for each set of robots
            where = f"{scenario.name}, {name}"
            plan = read_plan(folder / "plans" / f"{content.stems[scenario.name, name]}.json", instance)
            certificate = certify(executed, replace(plan, value=None, bound=None, fuel_s={}))
            claimed = getattr(figures, "feasible", True)
            if certificate.feasible != claimed:
                raise _Differs(f"{where}: the plan is {'' if certificate.feasible else 'in'}feasible"
                               + "".join(f"; {reason}" for reason in certificate.reasons[:1]))
            if certificate.expected is not None:
                _compare(f"{where}: expected", figures.expected, certificate.expected, _SAME)
            if certificate.feasible and name == "deterministic":
                _compare(f"{where}: promised", figures.promised, certificate.nominal, _SAME)
            if certificate.feasible and name == "stochastic":
                _compare(f"{where}: promised", figures.promised, certify(instance, replace(
                    plan, value=None, bound=None, fuel_s={})).expected, _SAME)
            count += 1
    return counted(count, "certificate")


def _figures(folder: Path, content: Content) -> str:
    """Check the summary's figures against the outcomes."""
    found = recount(folder / "outcomes.parquet")
    count = 0
    for scenario in content.summary.scenarios:
        for key, plans in _plans_of(scenario):
            for name, figures in plans.items():
                _check_plan((scenario.name, name, *key), figures, found, ends=key[0] == "none")
                count += 1
        if isinstance(scenario, ScenarioSummary):
            for key, vss in (("none", "never"), scenario.vss), *(
                    ((r.policy, r.news), r.vss) for r in scenario.reactions or ()):
                best, plain = (found[scenario.name, name, *key].mean for name in ("stochastic", "deterministic"))
                _compare(f"{scenario.name}: vss.executed.mean", vss.executed.mean, best - plain, _SUMMED)
                if vss.executed_pct is not None:
                    _compare(f"{scenario.name}: vss.executed_pct", vss.executed_pct,
                             100 * (best - plain) / best if best else None, _SUMMED)
    return f"figures of {counted(count, 'executed plan')}"


def _plans_of(scenario: ScenarioSummary | ComparedScenario
              ) -> Iterator[tuple[tuple[PolicyName, News], Mapping[str, PlanFigures]]]:
    """Policy and news, and the plans under them."""
    yield ("none", "never"), scenario.plans
    for reaction in scenario.reactions or ():
        yield (reaction.policy, reaction.news), reaction.plans


def _check_plan(key: Key, figures: PlanFigures, found: Mapping[Key, Recount], *, ends: bool) -> None:
    where = ", ".join(word for word in key if word not in ("none", "never"))
    again = found[key]
    _compare(f"{where}: executed.mean", figures.executed.mean, again.mean, _SUMMED)
    for robot, mean in figures.by_robot.items():
        _compare(f"{where}: by_robot.{robot}", mean, again.by_robot.get(robot), _SUMMED)
    if ends and dict(figures.ends) != dict(again.ends):
        raise _Differs(f"{where}: ends are {dict(figures.ends)} in summary.json, and {dict(again.ends)} in "
                       "outcomes.parquet")
    ledger = dict(vars(figures.ledger))
    _compare(f"{where}: ledger.executed", ledger.pop("executed"), again.mean, _SUMMED)
    _compare(f"{where}: the ledger's sum", sum(amount for amount in ledger.values() if amount is not None),
             again.mean, _SUMMED)


def _compare(what: str, there: float | None, again: float | None, tolerance: float) -> None:
    if there is None or again is None or not np.isclose(there, again, rtol=tolerance, atol=tolerance):
        raise _Differs(f"{what} is {there} in the folder, and {again} when worked out again")


def _trials(folder: Path, content: Content, costs: Mapping[str, FuelCosts], sample: int, executor: Executor | None,
            progress: OnProgress) -> list[str]:
    """Play some trials of each plan and reaction again."""
    executed = [Wanted(scenario=scenario.name, trial=0, planner=name, policy=policy, news=news)
                for scenario in content.summary.scenarios for (policy, news), plans in _plans_of(scenario)
                for name in plans if name != "informed"]
    outcomes, played = folder / "outcomes.parquet", 0
    for number, first in enumerate(executed):
        progress("playing trials again", number, len(executed))
        key = first.scenario or "", first.planner or "", first.policy, first.news or "never"
        for trial in _spread(last_trial(outcomes, key) + 1, sample):
            for one in cases_of(folder, content, replace(first, trial=trial)):
                again = play_again(content, costs, one, None, executor)
                for there, here in zip(rows_of_trial(outcomes, key, trial), again.rows, strict=True):
                    _check_row(key, trial, there, here)
                played += 1
    progress("playing trials again", len(executed), len(executed))
    return [f"{counted(played, 'trial')} played again, the same row by row"] if played else []


def _check_row(key: Key, trial: int, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    for column, value in there.items():
        if here[column] != value:
            where = ", ".join(word for word in key if word not in ("none", "never"))
            raise _Differs(f"{where}, trial {trial}, {there['robot']}: {column} is {value} in outcomes.parquet, and "
                           f"{here[column]} when it is played again")


def _spread(count: int, sample: int) -> Sequence[int]:
    """So many numbers below ``count``, the first and the last among them."""
    return sorted({int(number) for number in np.linspace(0, count - 1, min(sample, count)).round()})
