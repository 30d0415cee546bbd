"""Whether all that a run needs works here, each part tried on something tiny."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sva_bench import __version__
from sva_bench.cli.loading import loading
from sva_bench.files.atomic import try_out
from sva_bench.files.printable import counted
from sva_bench.files.versions import library_versions

State = Literal["ok", "missing", "failed"]
_CLOSE = 0.02  # relative: physics and twin on a leg of a metre
_BROWSERS = ("firefox", "chromium", "chromium-browser", "google-chrome", "microsoft-edge", "open", "xdg-open")


@dataclass(frozen=True, kw_only=True)
class Checked:
    """One part of the installation.

    Attributes:
        part: What it is.
        state: ``missing`` parts are for one command or option each; all else works without.
        found: What was found, or what to do.
    """

    part: str
    state: State
    found: str

    def as_dict(self) -> dict[str, Any]:
        """The content of ``--json``."""
        return dict(vars(self))


class _Missing(Exception):
    """An optional part is not here."""


def check_installation() -> list[Checked]:
    """Try every part, whatever becomes of those before it."""
    found = []
    for part, check in _CHECKS.items():
        try:
            found.append(Checked(part=part, state="ok", found=check()))
        except _Missing as error:
            found.append(Checked(part=part, state="missing", found=str(error)))
        except Exception as error:  # a broken installation may raise anything
            said = f"{type(error).__name__}: {error}".splitlines()[0][:300]
            found.append(Checked(part=part, state="failed", found=said))
    return found


def _python() -> str:
    return f"{platform.python_implementation()} {platform.python_version()} on {platform.system()} {platform.machine()}"


def _libraries() -> str:
    try:
        return ", ".join(f"{name} {version}" for name, version in library_versions().items())
    except PackageNotFoundError as error:
        raise RuntimeError(f"{error.name} is not installed; install sva-bench again") from None


def _physics() -> str:
    """Drive a metre by the twin and in physics."""
    with loading():
        from sva_bench.execution.driving import DriveTask, drive_route
        from sva_bench.geometry.obstacles import Obstacles
        from sva_bench.robot.follower import stretches
        from sva_bench.robot.model import BUILT_IN

    room = Obstacles(bounds_m=np.array([0.0, 0, 4, 4]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))
    hop = stretches(np.array([[1.0, 1.0], [2.0, 1.0]]), 0.0)
    twin, physics = (float(drive_route(DriveTask(
        obstacles=room, model=BUILT_IN["turtlebot2"], start=(1.0, 1.0, 0.0), legs=((hop,),), fidelity=fidelity,
        traced=False)).leg_s[0]) for fidelity in ("kinematic", "physics"))
    if not abs(physics - twin) <= _CLOSE * twin:
        raise RuntimeError(f"a metre takes {physics:.2f} s in physics, and {twin:.2f} s by the twin")
    return f"drives a metre in {physics:.2f} s, the twin in {twin:.2f} s"


def _planner() -> str:
    """Plan a path round a wall."""
    with loading():
        from sva_bench.geometry.obstacles import Obstacles
        from sva_bench.travel.roadmap import plan_paths

    wall = Obstacles(bounds_m=np.array([0.0, 0, 4, 4]), boxes=np.array([[2.0, 1.5, 0.1, 1.5, 0.0]]),
                     cylinders=np.empty((0, 3)))
    path = plan_paths(wall, np.array([[1.0, 1.0], [3.0, 1.0]]), 0.25)[0][1]
    if path is None:
        raise RuntimeError("found no path round a wall")
    return f"finds a path of {float(np.hypot(*np.diff(path, axis=0).T).sum()):.1f} m round a wall"


def _solver() -> str:
    """Prove a small plan optimal."""
    with loading():
        from sva_bench.generate.instances import random_instance
        from sva_bench.solver.two_stage import SolveLimits, plan_stochastic

    plan = plan_stochastic(random_instance("A", pois=8, vehicles=2, availability=0.75, seed=0), SolveLimits())
    if plan.status != "optimal":
        raise RuntimeError(f"a plan of 8 POIs ended {plan.status}")
    return f"proves a plan of 8 POIs optimal, value {plan.value:.6g}"


def _recording() -> str:
    """Find the viewer that belongs to the library that records."""
    with loading():
        from sva_bench.recording.viewer import program

    viewer = Path(program()[0])
    if not viewer.exists():
        raise RuntimeError(f"{viewer} is missing; install rerun-sdk again")
    return "recordings and their viewer"


def _pictures() -> str:
    with loading():
        from sva_bench.recording.viewer import NoVulkanDriver, drawing_environment

    try:
        drawing_environment(os.environ)
    except NoVulkanDriver as error:
        raise _Missing(f"for view --screenshot: {error}") from None
    return "a Vulkan driver, for view --screenshot"


def _browser() -> str:
    found = next((name for name in _BROWSERS if shutil.which(name)), None)
    if found is None:
        raise _Missing("no browser was found, for report.html and view --web; pages can be opened on another machine")
    return f"{found}, for report.html and view --web"


def _machine() -> str:
    with loading():
        from sva_bench.workers.pool import usable_cores

    memory = ""
    if (told := Path("/proc/meminfo")).exists():
        total = next((line.split()[1] for line in told.read_text(encoding="ascii").splitlines()
                      if line.startswith("MemTotal")), None)
        memory = "" if total is None else f", {int(total) / 2**20:.0f} GiB of memory"
    return counted(usable_cores(), "core") + memory


def _folders() -> str:
    """Whether the cache of batches can be written."""
    with loading():
        from sva_bench.batch.cache import default_folder

    cache = default_folder()
    there = cache
    while not there.exists():
        there = there.parent
    try:
        try_out(there)
        with tempfile.TemporaryFile():
            pass
    except OSError as error:
        raise _Missing(f"{error}; name another folder with --cache, or set TMPDIR") from None
    return f"the cache of batches is {cache}"


def _distributed() -> str:
    if find_spec("distributed") is None:
        raise _Missing("for batch --dask: install the package distributed")
    return "distributed, for batch --dask"


def _optional(package: str, extra: str, what: str) -> Callable[[], str]:
    """A check of an optional package."""
    def check() -> str:
        if find_spec(package) is None:
            raise _Missing(f"for {what}: pip install 'sva-bench[{extra}]'")
        return f"{package}, for {what}"
    return check


_CHECKS: dict[str, Callable[[], str]] = {
    "sva-bench": lambda: __version__, "Python": _python, "libraries": _libraries, "physics": _physics,
    "path planner": _planner, "solver": _solver, "recordings": _recording, "pictures": _pictures, "browser": _browser,
    "videos": _optional("av", "video", "view --video OUT.mp4"),
    "bags": _optional("mcap_ros2", "mcap", "export --to mcap"),
    "cluster": _distributed, "folders": _folders, "machine": _machine}

