"""Results of comparing the values of a key that a batch varies: what each is worth more than a reference."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sva_bench.analysis.results import Estimate, Interval, Words
from sva_bench.choices import SampleOf
from sva_bench.files.records import Record


@dataclass(frozen=True, kw_only=True)
class ValueGain(Estimate):
    """A paired difference against the reference.

    Attributes:
        ci95_adjusted: Its interval, widened so that those of all values of the key under one scenario hold together.
        distinguishable: Whether that excludes zero.
    """

    ci95_adjusted: Interval | None
    distinguishable: bool


@dataclass(frozen=True, kw_only=True)
class ValueRow(Record):
    """One value of the key under one scenario.

    Attributes:
        scenario: The scenario.
        others: The other varied settings; empty if there are none.
        value: The value of the key, as JSON.
        maps: Number of maps.
        executed, vss: Executed value of the stochastic plan, and executed VSS, at this value of the key.
        gain, vss_gain: How much more each is than at the reference, paired by map, seed, trial and noise draw;
            ``None`` of the reference itself, and where nothing can be paired.
    """

    scenario: Words
    others: Words
    value: Words
    maps: int
    executed: Estimate
    vss: Estimate
    gain: ValueGain | None = None
    vss_gain: ValueGain | None = None


@dataclass(frozen=True, kw_only=True)
class KeyComparison(Record):
    """The values of one varied key, compared with a reference.

    Attributes:
        key: The key, as it was varied.
        reference: The value that others are compared with, as JSON.
        values: All values, as JSON, in their order.
        sample: What intervals are over: maps, or the trials of a single one.
        rows: Each scenario, with each combination of other settings, at each value.
    """

    key: Words
    reference: Words
    values: tuple[Words, ...]
    sample: SampleOf
    rows: tuple[ValueRow, ...]


def variant_of(settings: Mapping[str, str]) -> str:
    """The name of a variant: its varied keys, each with its value as JSON; that of a planner is its bare name."""
    return "; ".join(f"{key}={value}" for key, value in settings.items())


def other_settings(settings: Mapping[str, str], key: str) -> dict[str, str]:
    """A variant's settings but for one."""
    return {name: value for name, value in settings.items() if name != key}


def shown_value(word: str) -> str:
    """A value as people write it: without the quotes of JSON."""
    try:
        value = json.loads(word)
    except ValueError:
        return word
    return value if isinstance(value, str) else word


def numbers_of(words: tuple[str, ...]) -> Mapping[str, float] | None:
    """The values as numbers on one axis, ``x1.2`` as 1.2; ``None`` if one of them is no number."""
    found = {}
    for word in words:
        plain = shown_value(word)
        match = re.fullmatch(r"(x?)(-?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)", plain)
        if match is None:
            return None
        found[word] = float(match[2])
    return found if len({plain.startswith("x") for plain in map(shown_value, words)}) == 1 else None


def own_value(values: Sequence[Any], in_files: Sequence[Any]) -> str | None:
    """The value of a key that leaves the files as they are, as JSON, if there is one.

    Args:
        values: The values of the key.
        in_files: What the world files have at all its places.
    """
    for value in values:
        if value in ("x1", "x1.0") or (in_files and all(
                type(value) is not bool and value == found for found in in_files)):
            return json.dumps(value)
    return None
