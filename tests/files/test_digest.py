"""Content hashes tell different content apart, and only that."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest

from sva_bench.files.digest import digest
from sva_bench.files.versions import library_versions
from tests.worlds_for_tests import SMALL, world_of


def test_equal_worlds_have_equal_hashes_and_any_other_figure_another(tmp_path: Path) -> None:
    one, same = world_of(tmp_path), world_of(tmp_path)
    other = world_of(tmp_path, SMALL.replace("stop_s: 4", "stop_s: 5"))
    assert digest(one) == digest(same)
    assert digest(one) != digest(other)


def test_content_that_only_looks_alike_has_other_hashes() -> None:
    alike = [["ab", "c"], ["a", "bc"], ["abc"], [["ab"], "c"], {"ab": "c"}, 1, 1.0, True, "1", None, np.array([1]),
             np.array([1.0]), np.array([[1]])]
    assert len({digest(item) for item in alike}) == len(alike)


@pytest.mark.parametrize("installed", ["pybullet", "pybullet-arm64"])
def test_the_engines_version_is_that_of_the_package_that_is_installed(
    installed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def version(package: str) -> str:
        if package.startswith("pybullet") and package != installed:
            raise PackageNotFoundError(package)
        return "1.2"

    monkeypatch.setattr("sva_bench.files.versions.version", version)
    assert [name for name in library_versions() if name.startswith("pybullet")] == [installed]
    assert len(library_versions()) == 9
