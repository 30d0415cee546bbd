"""Which recordings of a run folder are of which plan."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from sva_bench.analysis.results import ScenarioPlans
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary
from sva_bench.errors import BadInput, nearest
from sva_bench.files.read_back import read_ours
from sva_bench.storage.manifest import MANIFEST, Manifest, RecordingNote
from sva_bench.storage.run_folder import pair_stem, recording_stem
from sva_bench.storage.stored_run import read_summary
from sva_bench.storage.trial_choice import TrialChoice

# ``S3-stochastic+resolve-report-trial17``; of plans from elsewhere, whose names may hold anything, before them.
_WHICH = re.compile(r"(?:[+@]|[+@][a-z]+-[a-z]+-)(median|worst|trial[0-9]+)(?:$|\+)")


def recordings_for(folder: Path, scenario: str | None, planner: str | None, choice: TrialChoice | None = None
                   ) -> tuple[Path, ...]:
    """The recordings of a run that are of a scenario, a planner's plan, and a trial: replayed trials and reactions too.

    The most telling come first: of the scenario in which plans differ most, and in it two plans side by side before the
    plans, the first plan before the others, and what was recorded by the run before what was replayed.

    Args:
        folder: The run folder.
        scenario, planner: What is wanted; ``None`` = any. Two plans side by side are no planner's.
        choice: Of which trial; ``None`` = of any. One that was not recorded has none.

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
    notes: Mapping[str, RecordingNote] = {}
    if choice is not None:
        _, manifest = read_ours(folder / "manifest.json", Manifest, MANIFEST)
        notes = {note.file: note for note in manifest.recordings}
    found: list[tuple[tuple[int, int, bool, str], Path]] = []
    for path in (folder / "recordings").glob("*.rrd"):
        if path.stem in pairs:
            key: tuple[str, str | None] | None = pairs[path.stem], None
        else:
            key = _key_of(path.stem, stems, foreign=foreign)
        if key is None or (choice is not None and not _is_of(path, choice, notes)):
            continue
        if scenario in (None, key[0]) and (planner is None or planner == key[1]):
            rank = -1 if key[1] is None else planners.index(key[1])
            found.append(((order.index(key[0]), rank, path.stem not in stems, path.stem), path))
    if not found and choice is None:
        raise BadInput(f"{folder}: no recording is of "
                       + " and ".join(f"{option} {wanted}" for option, wanted in (
                           ("--scenario", scenario), ("--planner", planner)) if wanted is not None)
                       + "; 'sva-bench replay' records any trial")
    return tuple(path for _, path in sorted(found))


def most_telling(folder: Path) -> str:
    """The scenario of a run in which plans differ most."""
    return _telling(read_summary(folder))[0]


def _telling(summary: AnySummary) -> list[str]:
    """Scenarios by how much their plans differ in what was collected, the most first; else as in the summary."""
    spread = {}
    scenarios: Sequence[ScenarioPlans] = summary.scenarios
    for told in scenarios:
        means = [plan.executed.mean for plan in told.plans.values()]
        spread[told.name] = max(means) - min(means)
    return sorted(spread, key=lambda name: -spread[name])


def _is_of(path: Path, choice: TrialChoice, notes: Mapping[str, RecordingNote]) -> bool:
    """Whether a recording is of a trial, by what the manifest says, or by its name where it was replayed."""
    note = notes.get(path.name)
    if note is not None:
        return note.trial == choice.trial if choice.kind == "trial" else note.chosen == choice.kind
    which = _WHICH.search(path.stem)
    return choice.in_names is not None and which is not None and which[1] in (
        f"trial{choice.in_names}", str(choice.in_names))


def _key_of(stem: str, stems: dict[str, tuple[str, str]], *, foreign: bool) -> tuple[str, str] | None:
    """Scenario and planner of a recording, by its name."""
    if foreign and "@" in stem:  # <scenario>@<which>+<planner>, of which no scenario's name has an @
        scenario, _, rest = stem.partition("@")
        return stems.get(f"{scenario}+{rest.partition('+')[2]}")
    return stems.get(stem if foreign else stem.partition("+")[0])
