"""The worlds that ship with the bench, and a plan or two for each."""

from __future__ import annotations

from pathlib import Path

from sva_bench.errors import BadInput, nearest

_PACKAGE = Path(__file__).parents[1]
# In an installed package beside our code; in a checkout, which an editable install is too, at its top level.
_PLACES = (_PACKAGE / "shipped", _PACKAGE.parent)


def example_names() -> tuple[str, ...]:
    """The names of the shipped worlds."""
    return tuple(sorted(path.stem for path in (_place() / "worlds").glob("*.yaml")))


def example_world(name: str) -> Path:
    """The file of a shipped world.

    Raises:
        BadInput: If there is none of this name.
    """
    names = example_names()
    if name not in names:
        raise BadInput(f"no world of the name {name!r} ships with sva-bench; {nearest(name, list(names))}")
    return _place() / "worlds" / f"{name}.yaml"


def example_plans(name: str) -> tuple[Path, ...]:
    """The files of the plans that ship for a world."""
    longer = [other for other in example_names() if other.startswith(name) and other != name]
    return tuple(sorted(path for path in (_place() / "plans").glob(f"{name}-*.json")
                        if not any(path.stem.startswith(f"{other}-") for other in longer)))


def example_title(name: str) -> str:
    """The title of a shipped world, from the comment in its first line."""
    return example_world(name).read_text(encoding="utf-8").partition("\n")[0].removeprefix("#").strip()


def _place() -> Path:
    for place in _PLACES:
        if (place / "worlds").is_dir():
            return place
    raise BadInput("the shipped worlds are missing: this copy of sva-bench isn't whole; install it again")
