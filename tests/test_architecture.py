"""Imports point one way, each heavy library is met in one file, and no module grows without bounds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "sva_bench"
FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = [path.relative_to(PACKAGE).as_posix() for path in FILES]

# What every part may know. Files at the top that know nothing of the others may be known by all.
EVERYBODYS = {"arrays", "atomic", "complaints", "documents", "errors", "interrupts", "json_lines", "mistaken",
              "patterns", "printable", "read_back", "safe_path", "seeds"}
MAY_KNOW: dict[str, set[str]] = {
    "arrays": set(), "errors": set(), "interrupts": set(), "printable": set(), "safe_path": set(), "mistaken": set(),
    "atomic": {"errors", "interrupts"}, "patterns": {"errors"}, "complaints": {"errors"}, "json_lines": {"complaints"},
    "documents": {"complaints", "errors", "json_lines", "mistaken"}, "read_back": {"documents", "errors"},
    "seeds": {"arrays"},
    "robot": set(),
    "mission": set(),
    "world": {"robot", "mission.failures"},
    "travel": {"world", "robot"},
    "solver": {"mission"},
    "execution": {"world", "robot", "travel", "mission"},
    "analysis": {"world", "robot", "travel", "mission", "execution"},
    "recording": {"world", "robot", "travel", "mission", "execution"},
    "tables": set(),
    "outcome_table": {"execution", "tables"},
    "runs": {"world", "robot", "travel", "mission", "execution", "outcome_table", "tables"},
    "workers": {"execution"},
}
# These put the parts together, and may know all.
TOP = {"options", "inputs", "bench", "planning", "batch", "pictures", "proposal", "worlds", "stored", "informed",
       "precision", "tally", "assumptions", "reproduce", "cli", "cli_batch", "cli_inputs", "cli_plans", "live",
       "loading", "outputs", "seal", "streams", "sweeps", "terminal", "usage", "variants", "results_schema", "__main__",
       "__init__"}
# Of these, those that the command line stands on: they know nothing of it.
BENCH = {"bench", "planning", "batch", "pictures", "proposal", "worlds", "stored", "informed", "precision", "tally",
         "assumptions", "reproduce", "results_schema", "variants"}
ONLY_IN = {
    "pybullet": "execution/simulator.py", "pybullet_data": "execution/simulator.py",
    "pybullet_utils": "execution/simulator.py", "ompl": "travel/roadmap.py", "highspy": "solver/highs.py",
    "rerun": "recording/rerun.py", "networkx": "solver/cuts.py", "ruamel": "documents.py",
    "matplotlib": "analysis/drawing.py", "PIL": "world/images.py", "distributed": "batch/dask_cluster.py",
}
MOST_LINES = 450


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


def part_of(module: str) -> str:
    """``world/load.py`` is of the part ``world``, ``seeds.py`` of ``seeds``."""
    return module.split("/")[0].removesuffix(".py")


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_one_way(module: str) -> None:
    part = part_of(module)
    if part in TOP:
        allowed = set(MAY_KNOW) | BENCH
        if part not in BENCH:
            allowed |= {"cli", "cli_batch", "cli_inputs", "cli_plans", "inputs", "live", "loading", "options",
                        "outputs", "seal", "streams", "sweeps", "terminal", "usage"}
    else:
        assert part in MAY_KNOW, f"say in MAY_KNOW what {part} may import"
        allowed = MAY_KNOW[part] | {part} | (EVERYBODYS if part not in EVERYBODYS else set())
    for line, name in imports_of(PACKAGE / module):
        if not name.startswith("sva_bench."):
            continue
        known = name.removeprefix("sva_bench.")
        if known == "__version__":
            continue
        assert any(known == a or known.startswith(a + ".") for a in allowed), (
            f"sva_bench/{module}:{line} imports {name}; {part} may know {', '.join(sorted(allowed)) or 'nothing'}")


def test_the_allowed_directions_close_no_circle() -> None:
    knows = {part: {known.split(".")[0] for known in allowed} for part, allowed in MAY_KNOW.items()}
    left = dict(knows)
    while left:
        free = [part for part, known in left.items() if not known & set(left)]
        assert free, f"circle among {sorted(left)}"
        for part in free:
            del left[part]


def test_solver_and_execution_never_see_each_other() -> None:
    assert "execution" not in MAY_KNOW["solver"]
    assert "solver" not in MAY_KNOW["execution"]
    assert not {"world", "travel", "execution"} & (MAY_KNOW["mission"] | MAY_KNOW["solver"])


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
