"""What stands below a map's key in a world file, whatever its format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from sva_bench.files.fields import Section
from sva_bench.geometry.cells import Cells
from sva_bench.world.maps.files import MapFile

FileName = Annotated[str, Field(min_length=1, max_length=1000)]


class MapSection(Section):
    """The file of a map, and how it is to be read; each format has its own."""

    file: FileName

    def read(self, root: Path, *, anywhere: bool = False) -> tuple[Cells, tuple[MapFile, ...]]:
        """Read the map.

        Args:
            root: The folder that no file may leave; ``file`` is relative to it.
            anywhere: Let files that the map names lie outside the folder.

        Returns:
            The grid; and the files that were read, the one that the world names first.

        Raises:
            BadFile: With file, line, key and what to change.
        """
        raise NotImplementedError

    def written(self) -> dict[str, str | float]:
        """The section as a new world file has it: without what is so by default and goes without saying."""
        return self.model_dump()
