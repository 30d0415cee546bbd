"""The section below a map's key in a world file, common to all formats."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import Annotated

from pydantic import Field

from sva_bench.files.fields import Section
from sva_bench.geometry.cells import Cells
from sva_bench.world.maps.files import MapFile

FileName = Annotated[str, Field(min_length=1, max_length=1000)]


class MapSection(Section):
    """The file of a map, and settings of its reading; each format has a subclass."""

    file: FileName

    @abstractmethod
    def read(self, root: Path, *, anywhere: bool = False) -> tuple[Cells, tuple[MapFile, ...]]:
        """Read the map.

        Args:
            root: The folder that no file may leave; ``file`` is relative to it.
            anywhere: Whether files that the map names may be outside the folder.

        Returns:
            The grid; and the files that were read, the one that the world names first.

        Raises:
            BadFile: With file, line, key and what to change.
        """

    def written(self) -> dict[str, str | float]:
        """The section as written into a new world file, without redundant defaults."""
        return self.model_dump()
