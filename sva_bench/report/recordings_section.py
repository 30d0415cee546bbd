"""The recordings of a run, as a table of links by scenario and plan."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from sva_bench.analysis.plan_names import ShownNames
from sva_bench.report.page import heading, note, table_of_html, text
from sva_bench.report.wording import listed
from sva_bench.storage.manifest import RecordingNote
from sva_bench.storage.stored_run import Content


def recordings_section(content: Content, shown: ShownNames) -> list[str]:
    """The section of the page."""
    lacking = content.lacking
    cells = _cells(content, shown)
    plans = list(dict.fromkeys(plan for by_plan in cells.values() for plan in by_plan))
    parts = [heading("Recordings")]
    if plans:
        parts += ["<p>For the Rerun viewer; open them all with <code class=whole>sva-bench view</code> and this "
                  "folder.</p>",
                  table_of_html(["scenario", *plans], [
                      [text(scenario), *("<br>".join(by_plan.get(plan, ())) for plan in plans)]
                      for scenario, by_plan in cells.items()])]
        told = ["Typical: a typical trial of the plan."]
        if BESIDE in plans:
            told.append("Side by side: two plans under the same failures and noise, where they differ.")
        if any(policy != "none" for _, _, policy, _ in content.reaction_stems):
            told.append("With news: the most probable course of events in which orders change.")
        parts.append(note(" ".join(told)))
    if lacking:
        parts.append(note(f"Missing in this run folder: {', '.join(lacking)}. This page doesn't rest on them."))
    return parts


BESIDE = "side by side"


def _cells(content: Content, shown: ShownNames) -> Mapping[str, Mapping[str, list[str]]]:
    """Links by scenario and plan."""
    found: dict[str, dict[str, list[str]]] = {}

    def add(scenario: str, plan: str, stem: str, what: str) -> None:
        if f"recordings/{stem}.rrd" not in content.lacking:
            found.setdefault(scenario, {}).setdefault(plan, []).append(
                f'<a href="recordings/{quote(stem)}.rrd">{text(what)}</a>')

    notes = [told for told in content.manifest.recordings if told.policy == "none" and told.file.endswith(".rrd")]
    for (scenario, planner), stem in content.stems.items():
        add(scenario, shown.of(scenario, planner), stem, "typical")
    for told in notes:
        if len(told.planners) == 1 and told.chosen in ("trial", "median", "worst"):
            add(told.scenario, shown.of(told.scenario, told.planners[0]), _stem(told), _asked(told))
    for (scenario, planner, policy, news), stem in content.reaction_stems.items():
        add(scenario, shown.of(scenario, planner), stem, f"{policy}, {news} news")
    for told in notes:
        if len(told.planners) > 1:
            add(told.scenario, BESIDE, _stem(told), listed([shown.of(told.scenario, name) for name in told.planners]))
    return found


def _stem(told: RecordingNote) -> str:
    return told.file.removesuffix(".rrd")


def _asked(told: RecordingNote) -> str:
    return f"trial {told.trial}" if told.chosen == "trial" else f"{told.chosen}: trial {told.trial}"
