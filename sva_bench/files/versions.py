"""The libraries that results depend on, and their versions here."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

LIBRARIES = (("numpy",), ("scipy",), ("numba",), ("pybullet", "pybullet-arm64"), ("ompl",), ("highspy",), ("networkx",),
             ("rerun-sdk",), ("pyarrow",))
"""Each by the names of the packages that provide it: which one is installed depends on the Python version."""


def library_versions() -> dict[str, str]:
    """The version of each library, by the name of the package that is installed."""
    return dict(_installed(packages) for packages in LIBRARIES)


def _installed(packages: tuple[str, ...]) -> tuple[str, str]:
    for package in packages[:-1]:
        try:
            return package, version(package)
        except PackageNotFoundError:
            continue
    return packages[-1], version(packages[-1])
