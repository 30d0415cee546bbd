"""The registry of map formats, one line each, for the world file, its schema and from-map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sva_bench.errors import BadInput
from sva_bench.world.maps.movingai import MovingAiMap
from sva_bench.world.maps.ros import RosMap
from sva_bench.world.maps.section import MapSection


@dataclass(frozen=True, kw_only=True)
class MapFormat:
    """A map format.

    Attributes:
        key: Its key below ``map:`` in a world file.
        section: The section below that key, which reads the map.
        maps: What such maps are called, in the plural.
        suffixes: Suffixes of files that from-map reads as such a map.
        asked_for: How messages ask for such a file.
        lacks: Options of other formats that it doesn't support, and why.
    """

    key: str
    section: type[MapSection]
    maps: str
    suffixes: tuple[str, ...]
    asked_for: str
    lacks: Mapping[str, str] = field(default_factory=dict)

    def takes(self, option: str) -> bool:
        """Whether an option is one of its settings."""
        return option in self.section.model_fields


_ALL = (
    MapFormat(key="ros", section=RosMap, maps="ROS maps", suffixes=(".yaml", ".yml"),
              asked_for="the YAML file of a ROS map", lacks={"cell_m": "a ROS map says its resolution"}),
    MapFormat(key="movingai", section=MovingAiMap, maps="MovingAI maps", suffixes=(".map",),
              asked_for="a MovingAI map whose name ends in .map",
              lacks={"unknown": "a MovingAI map has no unknown cells"}),
)
FORMATS: Mapping[str, MapFormat] = {form.key: form for form in _ALL}
"""The formats by their keys, in the order in which messages name them."""


def format_of(path: Path) -> MapFormat:
    """The format of a map's file, by its suffix.

    Raises:
        BadInput: If no format has this suffix.
    """
    for form in FORMATS.values():
        if path.suffix.lower() in form.suffixes:
            return form
    raise BadInput(f"{path}: a map is {', or '.join(form.asked_for for form in FORMATS.values())}")


def settings_for(form: MapFormat, given: Mapping[str, object]) -> dict[str, object]:
    """The options that were given, as settings of a format.

    Args:
        form: The format.
        given: Value of each option by name; ``None`` = not given.

    Raises:
        BadInput: If one belongs to another format.
    """
    settings = {option: value for option, value in given.items() if value is not None}
    for option in settings:
        if not form.takes(option):
            owners = " and ".join(other.maps for other in FORMATS.values() if other.takes(option))
            why = form.lacks.get(option, f"{form.maps} have no such setting")
            raise BadInput(f"--{option.replace('_', '-')} belongs to {owners}; {why}")
    return settings
