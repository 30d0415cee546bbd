"""Imports point one way, each heavy library is met in one file, and no module grows without bounds."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "sva_bench"
FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = [path.relative_to(PACKAGE).as_posix() for path in FILES]

# Low to high: each may know those before it, whoever asks, and when.
ROOMS = (
    "environment", "arrays", "errors", "seeds", "interrupts", "choices", "palette", "files", "workers", "geometry",
    "robot", "mission", "world", "solver", "travel", "execution", "analysis", "recording", "storage", "report", "study",
    "generate", "batch", "paper", "cli", "__init__", "__main__",
)
# The same within the solver, whose rooms are many.
SOLVER = (
    "polling", "program", "highs", "outcomes", "risk", "discounts", "goal", "units", "preprocess", "routes",
    "knowledge", "problem", "searching", "flow", "edges", "columns", "methods", "solve", "ties", "finished",
    "two_stage", "rest",
)
ONLY_IN: dict[str, tuple[str, ...]] = {
    "pybullet": ("execution/engines/bullet.py",), "pybullet_data": ("execution/engines/bullet.py",),
    "pybullet_utils": ("execution/engines/bullet.py",), "ompl": ("travel/roadmap.py",),
    "highspy": ("solver/highs.py",), "rerun": ("recording/rerun.py",),
    "networkx": ("solver/flow/cuts.py",),
    "ruamel": ("files/yaml_text.py",), "PIL": ("world/maps/images.py", "recording/pictures.py"),
    "av": ("recording/video.py",),
    "distributed": ("workers/dask.py",),
    "mcap_ros2": ("recording/bag.py",),
    # Charts, pictures of worlds and their legend, and the paper's own figure.
    "matplotlib": ("report/canvas.py", "report/drawing.py", "report/legend.py", "paper/gaps_picture.py"),
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


def part_of(module: str) -> str:
    """``solver/flow/cuts.py`` is in the solver's part ``flow``."""
    return module.split("/")[1].removesuffix(".py")


SOLVER_MODULES = [module for module in MODULES if room_of(module) == "solver" and module != "solver/__init__.py"]


@pytest.mark.parametrize("module", SOLVER_MODULES)
def test_imports_within_the_solver_point_one_way(module: str) -> None:
    part = part_of(module)
    assert part in SOLVER, f"say in SOLVER what {part} may import"
    allowed = SOLVER[: SOLVER.index(part) + 1]
    for line, name in imports_of(PACKAGE / module):
        if name.startswith("sva_bench.solver."):
            assert name.split(".")[2] in allowed, (
                f"sva_bench/{module}:{line} imports {name}; {part} may know {', '.join(allowed[:-1]) or 'nothing'}")


@pytest.mark.parametrize("module", SOLVER_MODULES)
def test_the_solver_learns_of_failures_in_numbers(module: str) -> None:
    # ``two_stage`` and ``rest`` ask the process for them; nothing below them knows that there are processes.
    if part_of(module) not in ("two_stage", "rest"):
        for line, name in imports_of(PACKAGE / module):
            assert not name.startswith("sva_bench.mission.failures"), f"sva_bench/{module}:{line} imports {name}"


def test_every_part_of_the_solver_is_there() -> None:
    assert set(SOLVER) == {part_of(module) for module in SOLVER_MODULES}


def test_solver_and_execution_never_see_each_other() -> None:
    # The solver comes first, so it can't; execution could.
    for module in MODULES:
        if room_of(module) == "execution":
            known = {name.split(".")[1] for _, name in imports_of(PACKAGE / module) if name.startswith("sva_bench.")}
            assert "solver" not in known, module


@pytest.mark.parametrize("module", MODULES)
def test_each_heavy_library_is_imported_in_one_file(module: str) -> None:
    for line, name in imports_of(PACKAGE / module):
        homes = ONLY_IN.get(name.split(".")[0], (module,))
        assert module in homes, f"sva_bench/{module}:{line} imports {name}, which belongs in {', '.join(homes)}"


@pytest.mark.parametrize("library", ["pybullet", "ompl", "highspy", "rerun", "networkx", "ruamel", "matplotlib", "PIL",
                                     "distributed"])
def test_the_file_that_a_heavy_library_belongs_in_does_import_it(library: str) -> None:
    # Else a renamed file would make the rule above hold for nothing.
    for home in ONLY_IN[library]:
        assert library in {name.split(".")[0] for _, name in imports_of(PACKAGE / home)}


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


@pytest.mark.parametrize("module", [module for module in MODULES if room_of(module) == "cli"])
def test_a_command_loads_what_takes_long_in_the_one_way_there_is(module: str) -> None:
    # Ctrl-C in the middle of a native library's initialisation would abort the process.
    tree = ast.parse((PACKAGE / module).read_text(encoding="utf-8"))
    held = {id(node) for block in ast.walk(tree) if isinstance(block, ast.With)
            and ast.unparse(block.items[0].context_expr) == "loading()" for node in block.body}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for node in ast.walk(function):
                if isinstance(node, ast.Import | ast.ImportFrom):
                    assert id(node) in held, f"sva_bench/{module}:{node.lineno}: import it in a block of loading()"


def test_a_check_loads_neither_physics_nor_solvers_nor_statistics() -> None:
    # They take longer to load than a check of most worlds takes.
    heavy = {"pybullet", "highspy", "networkx", "scipy.stats", "scipy.optimize"}
    code = ("import sys, sva_bench.cli.app, sva_bench.study.costs, sva_bench.study.inputs, sva_bench.analysis.reach\n"
            f"print(sorted({heavy!r} & set(sys.modules)))")
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


LONGEST = 60


@pytest.mark.parametrize("module", MODULES)
def test_a_long_function_gives_its_reason(module: str) -> None:
    for node in ast.walk(ast.parse((PACKAGE / module).read_text(encoding="utf-8"))):
        # What follows the signature, which of a command is the list of its options.
        if isinstance(node, ast.FunctionDef) and (node.end_lineno or 0) - node.body[0].lineno >= LONGEST:
            assert "compiled" in (ast.get_docstring(node) or ""), (
                f"sva_bench/{module}:{node.lineno}: {node.name} has more than {LONGEST} lines: name its middle, or "
                "give the reason in its docstring")
