"""Short names of a batch's variants: what varies is said once, and each variant goes by its values."""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.analysis.compared_values import shown_value
from sva_bench.analysis.over_maps import BatchSummary


class VariantNames:
    """Names of the variants of a batch.

    Attributes:
        keys: The varied keys; empty where nothing is varied, or an older folder doesn't say.
    """

    def __init__(self, summary: BatchSummary) -> None:
        self._settings: Mapping[str, Mapping[str, str]] = summary.settings
        self.keys = tuple(dict.fromkeys(key for settings in summary.settings.values() for key in settings))

    def short(self, variant: str) -> str:
        """Its values: of one key by themselves, of several each behind the end of its key."""
        settings = self._settings.get(variant)
        if not settings:
            return variant
        return shown_value(settings[self.keys[0]]) if len(self.keys) == 1 else self.told(settings)

    def told(self, settings: Mapping[str, str]) -> str:
        """Settings, each behind the end of its key; empty for none."""
        return ", ".join(f"{_end_of(key, self.keys)} {shown_value(value)}" for key, value in settings.items())

    def whole(self, variant: str) -> str:
        """Its settings, as people write them."""
        settings = self._settings.get(variant)
        return variant if not settings else ", ".join(
            f"{key} = {shown_value(value)}" for key, value in settings.items())

    def labelled(self, name: str, variant: str) -> str:
        """A map or a scenario with the values of its variant."""
        return f"{name} ({self.short(variant)})" if variant else name


def _end_of(key: str, keys: tuple[str, ...]) -> str:
    """As much of a key's end as tells it from the others."""
    parts = key.split(".")
    for length in range(1, len(parts)):
        end = ".".join(parts[-length:])
        if sum(other == end or other.endswith(f".{end}") for other in keys) == 1:
            return end
    return key
