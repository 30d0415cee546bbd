"""Imports point one way, each heavy library is met in one file, and no module grows without bounds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "sva_bench"
FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = [path.relative_to(PACKAGE).as_posix() for path in FILES]

# Low to high: each may know those before it, whoever asks, and when.
ROOMS = (
    "safe_path", "arrays", "errors", "seeds", "interrupts", "choices", "files", "workers", "geometry", "robot",
    "mission", "world", "solver", "travel", "execution", "analysis", "recording", "storage", "report", "study",
    "generate", "batch", "paper", "cli", "__init__", "__main__",
)
ONLY_IN = {
    "pybullet": "execution/engines/bullet.py", "pybullet_data": "execution/engines/bullet.py",
    "pybullet_utils": "execution/engines/bullet.py", "ompl": "travel/roadmap.py", "highspy": "solver/highs.py",
    "rerun": "recording/rerun.py", "networkx": "solver/flow/cuts.py", "ruamel": "files/yaml_text.py",
    "matplotlib": "report/drawing.py", "PIL": "world/maps/images.py", "distributed": "workers/dask.py",
}
MOST_LINES = 425


def imports_of(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of everything that a file imports, inside functions too."""
    package = ["sva_bench", *path.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*start, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{module}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
                "import_module", "__import__") and node.args and isinstance(node.args[0], ast.Constant):
            yield node.lineno, str(node.args[0].value)


def room_of(module: str) -> str:
    """``world/load.py`` is in the room ``world``; ``seeds.py`` is one of its own."""
    return module.split("/")[0].removesuffix(".py")


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_one_way(module: str) -> None:
    room = room_of(module)
    assert room in ROOMS, f"say in ROOMS what {room} may import"
    allowed = ROOMS[: ROOMS.index(room) + 1]
    for line, name in imports_of(PACKAGE / module):
        if not name.startswith("sva_bench.") or name == "sva_bench.__version__":
            continue
        assert name.split(".")[1] in allowed, (
            f"sva_bench/{module}:{line} imports {name}; {room} may know {', '.join(allowed[:-1]) or 'nothing'}")


def test_every_room_is_there() -> None:
    assert set(ROOMS) == {room_of(module) for module in MODULES}


def test_solver_and_execution_never_see_each_other() -> None:
    # The solver comes first, so it can't; execution could.
    for module in MODULES:
        if room_of(module) == "execution":
            known = {name.split(".")[1] for _, name in imports_of(PACKAGE / module) if name.startswith("sva_bench.")}
            assert "solver" not in known, module


@pytest.mark.parametrize("module", MODULES)
def test_each_heavy_library_is_imported_in_one_file(module: str) -> None:
    for line, name in imports_of(PACKAGE / module):
        home = ONLY_IN.get(name.split(".")[0])
        assert home in (None, module), f"sva_bench/{module}:{line} imports {name}, which belongs in sva_bench/{home}"


@pytest.mark.parametrize("library", ["pybullet", "ompl", "highspy", "rerun", "networkx", "ruamel", "matplotlib",
                                     "distributed"])
def test_the_file_that_a_heavy_library_belongs_in_does_import_it(library: str) -> None:
    # Else a renamed file would make the rule above hold for nothing.
    found = {name.split(".")[0] for _, name in imports_of(PACKAGE / ONLY_IN[library])}
    assert library in found


@pytest.mark.parametrize("module", MODULES)
def test_no_module_wants_splitting(module: str) -> None:
    lines = len((PACKAGE / module).read_text(encoding="utf-8").splitlines())
    assert lines <= MOST_LINES, f"sva_bench/{module} has {lines} lines: it wants to be two"


def test_no_modules_import_each_other_in_a_circle() -> None:
    # Within a room too, whoever asks, and when: a module can be read after those that it imports.
    names = {module.removesuffix(".py").removesuffix("/__init__").replace("/", "."): module for module in MODULES}
    known = {module: {names[found] for _, name in imports_of(PACKAGE / module) if name.startswith("sva_bench.")
                      for found in (name.removeprefix("sva_bench."), name.removeprefix("sva_bench.").rpartition(".")[0])
                      if found in names and names[found] != module} for module in MODULES}
    left = dict(known)
    while ready := [module for module, needs in left.items() if not needs & left.keys()]:
        for module in ready:
            del left[module]
    assert not left, {module: sorted(needs & left.keys()) for module, needs in left.items()}
