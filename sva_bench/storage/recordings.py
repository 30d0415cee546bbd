"""Which recordings of a run folder are of which plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sva_bench.analysis.results import ScenarioPlans
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary
from sva_bench.errors import BadInput, nearest
from sva_bench.storage.run_folder import pair_stem, recording_stem
from sva_bench.storage.stored_run import read_summary


def recordings_for(folder: Path, scenario: str | None, planner: str | None) -> tuple[Path, ...]:
    """The recordings of a run that are of a scenario, and of a planner's plan: replayed trials and reactions too.

    The most telling come first: of the scenario in which plans differ most, and in it two plans side by side before the
    plans, the first plan before the others, and what was recorded by the run before what was replayed.

    Args:
        folder: The run folder.
        scenario, planner: What is wanted; ``None`` = any. Two plans side by side are no planner's.

    Raises:
        BadInput: If this is no run folder, or the run has no such scenario, plan or recording.
        BadFile: If its summary is damaged.
    """
    summary = read_summary(folder)
    scenarios: Sequence[ScenarioPlans] = summary.scenarios
    names = [told.name for told in scenarios]
    planners = list(dict.fromkeys(name for told in summary.scenarios for plans in (
        told.plans, *(reaction.plans for reaction in told.reactions or ())) for name in plans))
    for option, wanted, known in (("--scenario", scenario, names), ("--planner", planner, planners)):
        if wanted is not None and wanted not in known:
            raise BadInput(f"{option} {wanted[:60]!r}: the run has none of that name; {nearest(wanted, known)}")
    foreign = isinstance(summary, ComparisonSummary)
    stems = {recording_stem((s, p, "none", "never"), foreign=foreign): (s, p) for s in names for p in planners}
    pairs = {pair_stem(name, foreign=foreign): name for name in names}
    order = _telling(summary)
    found: list[tuple[tuple[int, int, bool, str], Path]] = []
    for path in (folder / "recordings").glob("*.rrd"):
        if path.stem in pairs:
            key: tuple[str, str | None] | None = pairs[path.stem], None
        else:
            key = _key_of(path.stem, stems, foreign=foreign)
        if key is not None and scenario in (None, key[0]) and (planner is None or planner == key[1]):
            rank = -1 if key[1] is None else planners.index(key[1])
            found.append(((order.index(key[0]), rank, path.stem not in stems, path.stem), path))
    if not found:
        raise BadInput(f"{folder}: no recording is of "
                       + " and ".join(f"{option} {wanted}" for option, wanted in (
                           ("--scenario", scenario), ("--planner", planner)) if wanted is not None)
                       + "; 'sva-bench replay' records any trial")
    return tuple(path for _, path in sorted(found))


def _telling(summary: AnySummary) -> list[str]:
    """Scenarios by how much their plans differ in what was collected, the most first; else as in the summary."""
    spread = {}
    scenarios: Sequence[ScenarioPlans] = summary.scenarios
    for told in scenarios:
        means = [plan.executed.mean for plan in told.plans.values()]
        spread[told.name] = max(means) - min(means)
    return sorted(spread, key=lambda name: -spread[name])


def _key_of(stem: str, stems: dict[str, tuple[str, str]], *, foreign: bool) -> tuple[str, str] | None:
    """Scenario and planner of a recording, by its name."""
    if foreign and "@" in stem:  # <scenario>@<which>+<planner>, of which no scenario's name has an @
        scenario, _, rest = stem.partition("@")
        return stems.get(f"{scenario}+{rest.partition('+')[2]}")
    return stems.get(stem if foreign else stem.partition("+")[0])
