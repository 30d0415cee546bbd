"""One trial of a run, chosen by its number or by what came of it, as among recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import RECORDED_WORDS, RecordedKind
from sva_bench.errors import BadInput, closest
from sva_bench.files.printable import shown
from sva_bench.storage.agreement import Key
from sva_bench.storage.manifest import RecordingNote
from sva_bench.storage.stored_run import last_trial, values_of_trials


@dataclass(frozen=True, kw_only=True)
class TrialChoice:
    """Which trial of a plan: ``trial`` by its number, or as it is chosen for a recording."""

    kind: RecordedKind = "trial"
    trial: int = 0

    @property
    def in_names(self) -> int | str | None:
        """What tells its recording from others of the plan by name; ``None`` of a typical one."""
        return self.trial if self.kind == "trial" else None if self.kind == "typical" else self.kind

    def __str__(self) -> str:
        return str(self.trial) if self.kind == "trial" else self.kind


def choice_of(word: str) -> TrialChoice:
    """The trial that an option's value stands for.

    Raises:
        BadInput: If it is neither a number nor a word for one.
    """
    for kind in _KINDS:
        if word == kind:
            return TrialChoice(kind=kind)
    if word.isascii() and word.isdecimal() and len(word) <= 12:
        return TrialChoice(trial=int(word))
    close = closest(word, list(RECORDED_WORDS))
    raise BadInput(f"--trial {shown(word)}: expected a trial's number, from 0 on, or {_WORDS}"
                   + (f"; did you mean {close!r}?" if close else ""))


_KINDS: Sequence[RecordedKind] = ("typical", "median", "worst")
assert tuple(RECORDED_WORDS) == _KINDS
_WORDS = f"{', '.join(_KINDS[:-1])} or {_KINDS[-1]}"


def trial_of(folder: Path, choice: TrialChoice, key: Key, notes: Sequence[RecordingNote]) -> int:
    """The number of a trial.

    Args:
        folder: The run folder.
        choice: Which trial.
        key: Scenario, planner, policy and news.
        notes: What the manifest says of the run's recordings: what is typical was found among all plans.

    Raises:
        BadInput: If there is no such trial.
        BadFile: If the outcomes can't be read.
    """
    outcomes, (scenario, planner, policy, news) = folder / "outcomes.parquet", key
    if choice.kind == "trial":
        last = last_trial(outcomes, key)
        if choice.trial > last:
            raise BadInput(f"--trial {choice}: {scenario}, {planner} has no such trial; the first is 0, the "
                           f"last {last}")
        return choice.trial
    if choice.kind == "typical":
        mine = [note.trial for note in notes if note.chosen == "typical" and planner in note.planners
                and (note.scenario, note.policy, note.news) == (scenario, policy, news)]
        if not mine:
            raise BadInput(f"--trial typical: the manifest names no typical trial of {scenario}, {planner}; give a "
                           "trial's number")
        return mine[0]
    number, value, weight = values_of_trials(outcomes, key)
    return int(number[value.argmin() if choice.kind == "worst" else nearest_to_median(value, weight)[0]])


def nearest_to_median(value: FloatArray, weight: FloatArray | None = None) -> IntArray:
    """Where a value is nearest to the median, of two in the middle to the lower one; ascending.

    Args:
        value: Shape (n,).
        weight: What each counts, shape (n,); ``None`` = all the same.
    """
    order = np.argsort(value, kind="stable")
    total = np.cumsum(np.ones(len(value)) if weight is None else weight[order])
    middle = value[order[np.searchsorted(total, total[-1] / 2 * (1 - 1e-9))]]
    away = np.abs(value - middle)
    return np.flatnonzero(away <= away.min() + 1e-9 * max(abs(float(middle)), 1.0))
