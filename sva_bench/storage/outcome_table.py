"""Outcomes as a table: the same rows and columns in the folder of a run and in the shards of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import ENDS
from sva_bench.execution.case import Settings
from sva_bench.execution.executed import Executed
from sva_bench.execution.reacted import Reacted
from sva_bench.storage.tables import OUTCOMES


def outcome_table(run: Executed | Reacted, robots: Sequence[str], settings: Settings) -> pa.Table:
    """One row per trial or history and robot, trial by trial."""
    trials, count = run.incentive.shape
    trial, history, weight = _numbers(run, settings)
    return pa.table({
        "scenario": constant(run.case.scenario.name, trials * count),
        "planner": constant(run.case.planner, trials * count),
        "policy": constant(run.case.policy, trials * count), "news": constant(run.case.news, trials * count),
        "trial": np.repeat(trial, count), "rollout": np.repeat(run.rollout, count),
        "history": np.repeat(history, count), "weight": np.repeat(weight, count),
        "robot": _words(np.tile(np.arange(count, dtype=np.int32), trials), robots),
        "available": run.available.ravel(), "incentive": run.incentive.ravel(),
        "lost": run.lost.ravel(), "value": run.value.ravel(),
        "pois_reached": run.pois_reached.ravel(), "stops_reached": run.stops_reached.ravel(),
        "end": _words(run.end.ravel().astype(np.int8), ENDS), "end_time_s": run.end_time_s.ravel(),
        "fuel_used_s": run.fuel_used_s.ravel(), "waited_s": run.waited_s.ravel(),
        "contacts": run.contacts.ravel(), "fidelity": constant(settings.fidelity, trials * count),
    }).cast(OUTCOMES)


def _numbers(run: Executed | Reacted, settings: Settings) -> tuple[IntArray, IntArray, FloatArray]:
    """Trial, history and weight of each row; trials that are sampled weigh 1 each."""
    trials = len(run.incentive)
    if isinstance(run, Executed):
        return settings.first + np.arange(trials), np.full(trials, -1), np.ones(trials)
    return run.trial, run.history, run.weight if run.enumerated else np.ones(trials)


def constant(word: str, rows: int) -> pa.Array:
    """A column that holds one word."""
    return _words(np.zeros(rows, dtype=np.int8), [word])


def _words(codes: np.ndarray[Any, Any], words: Sequence[str]) -> pa.Array:
    """Words by their numbers, spelt out by Arrow, which is quick at it."""
    return pa.DictionaryArray.from_arrays(pa.array(codes), pa.array(list(words))).cast(pa.string())
