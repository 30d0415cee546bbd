"""Which recordings of a run folder are of which plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sva_bench.analysis.results import ScenarioPlans
from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.errors import BadInput, nearest
from sva_bench.storage.run_folder import recording_stem
from sva_bench.storage.stored_run import read_summary


def recordings_for(folder: Path, scenario: str | None, planner: str | None) -> tuple[Path, ...]:
    """The recordings of a run that are of a scenario, and of a planner's plan: replayed trials and reactions too.

    Args:
        folder: The run folder.
        scenario, planner: What is wanted; ``None`` = any.

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
    found = []
    for path in sorted((folder / "recordings").glob("*.rrd")):
        key = _key_of(path.stem, stems, foreign=foreign)
        if key is not None and scenario in (None, key[0]) and planner in (None, key[1]):
            found.append(path)
    if not found:
        raise BadInput(f"{folder}: no recording is of "
                       + " and ".join(f"{option} {wanted}" for option, wanted in (
                           ("--scenario", scenario), ("--planner", planner)) if wanted is not None)
                       + "; 'sva-bench replay' records any trial")
    return tuple(found)


def _key_of(stem: str, stems: dict[str, tuple[str, str]], *, foreign: bool) -> tuple[str, str] | None:
    """Scenario and planner of a recording, by its name."""
    if foreign and "@" in stem:  # <scenario>@<which>+<planner>, of which no scenario's name has an @
        scenario, _, rest = stem.partition("@")
        return stems.get(f"{scenario}+{rest.partition('+')[2]}")
    return stems.get(stem if foreign else stem.partition("+")[0])
