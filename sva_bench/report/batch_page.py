"""The page of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sva_bench.analysis.over_maps import BatchSummary, OverMaps
from sva_bench.analysis.reach import maps_without_reach
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.calibration_over_maps import calibrated_over_maps
from sva_bench.report.calibration_page import bad_pct
from sva_bench.report.compared_values import compared_answers, compared_notes, compared_table, compared_title
from sva_bench.report.page import CONTENTS, figure, heading, note, sentence, table, write_page
from sva_bench.report.reaction_wording import knows_what_when
from sva_bench.report.reactions_over_maps import answers_over_maps, reaction_table
from sva_bench.report.results_charts import over_maps
from sva_bench.report.wording import (
    VSS_PCT,
    listed,
    optional,
    over_few_maps,
    per_cent,
    percentage,
    vss_verdict,
    with_interval,
)


def write_batch_report(path: Path, summary: BatchSummary) -> None:
    """Write the ``report.html`` of a batch."""
    rows, varied = summary.aggregate, any(summary.variants)
    over = [[*([row.variant] if varied else []), row.scenario, str(row.maps), with_interval(row.vss),
             percentage(row.vss_pct)] for row in rows]
    failed = [[entry.unit, entry.world, str(entry.seed), entry.reason] for entry in summary.failed]
    caution = over_few_maps(rows)
    parts = [
        f"<h1>Value of the stochastic solution over {counted(len(summary.worlds), 'map')}</h1>",
        f"<div class=answer><p>{sentence(_answer(summary))}</p>{_answered(summary)}{note(VSS_PCT)}</div>",
        table([*(["variant"] if varied else []), "scenario", "maps", "VSS", "VSS [%]"], over,
              words=(0, 1) if varied else (0,)),
        *([note(caution)] if caution else []),
        CONTENTS,
        *_compared(summary),
        *_reactions(summary),
        *(note(remark) for remark in maps_without_reach([unit.label for unit in summary.units if unit.reach.nothing])),
        note(f"{counted(summary.trials, 'trial')} of each plan in each scenario, fidelity {summary.fidelity}; 95 "
             "% intervals in brackets. Over maps, the maps are the sample."),
        *([heading("Given up"), table(["unit", "map", "seed", "reason"], failed, words=(0, 1, 3))] if failed else []),
        *_pictures(summary),
        heading("Map by map"),
        table(["scenario", "seed", "stochastic", "deterministic", "VSS", "VSS [%]", "VSS, modelled", "EVPI"],
              [[s.name, str(unit.seed), *(with_interval(plan.executed) for plan in (s.stochastic, s.deterministic)),
                vss_verdict(s.vss), per_cent(s.vss.executed_pct), f"{s.vss.modelled:.1f}", optional(s.evpi)]
               for unit in summary.units for s in unit.scenarios],
              sections=[unit.label for unit in summary.units for _ in unit.scenarios]),
    ]
    write_page(path, f"VSS over {counted(len(summary.worlds), 'map')}", [*parts, *_calibrated(summary)])


def _calibrated(summary: BatchSummary) -> list[str]:
    """How often calibrated plans go wrong and what they are worth, map by map."""
    rows = [[s.name, str(unit.seed), found.chosen.name + ("" if found.reached else " (share not reached)"),
             f"{found.nominal.promised:.1f}", f"{found.promised:.1f}", bad_pct(found.nominal.bad), bad_pct(found.bad),
             with_interval(s.stochastic.executed), with_interval(s.plans["calibrated"].executed)]
            for unit in summary.units for s in unit.scenarios if (found := s.calibration) is not None]
    if not rows:
        return []
    what_for, *lines = calibrated_over_maps(summary.units)
    return [heading("Calibrated plans"), f"<p>{sentence(what_for)}</p>",
            f"<ul>{''.join(f'<li>{sentence(line)}</li>' for line in lines)}</ul>",
            note("The nominal plan is the stochastic one. Missions go wrong by the twin, under draws of its own."),
            table(["scenario", "seed", "made for costs at", "promised, nominal", "promised, calibrated",
                   "go wrong, nominal", "go wrong, calibrated", "executed, nominal", "executed, calibrated"],
                  rows, words=(0, 2), sections=[
                      unit.label for unit in summary.units for s in unit.scenarios if s.calibration is not None])]


_MEANS = "Executed value of the stochastic plan: means, each with its own 95 % interval."
_DIFFERENCES = "Paired differences: intervals that hold together with 95 %. They may be sure where means are not."


def _compared(summary: BatchSummary) -> list[str]:
    """What the values of varied keys are worth."""
    if not summary.compared:
        return []
    parts = [heading("Which value is worth more?")]
    for found in summary.compared:
        head, words, cells = compared_table(found)
        parts += [f"<ul>{''.join(f'<li>{sentence(said)}</li>' for said in compared_answers(found))}</ul>",
                  response(found, _MEANS), response(found, _DIFFERENCES, more=True),
                  table(head, cells, words=words, caption=compared_title(found))]
    return [*parts, *map(note, compared_notes(summary.compared))]


def _reactions(summary: BatchSummary) -> list[str]:
    """What teams that react make of it."""
    if not summary.reactions:
        return []
    head, words, cells = reaction_table(summary.reactions, narrow=False)
    return [heading("Teams that react"), table(head, cells, words=words), note(
        "VSS: stochastic less deterministic plan under the reaction, of either sign. Recourse: what reacting adds to a "
        "plan. VSS with recourse and anticipation: the best plan for the reaction less the deterministic and the "
        "stochastic one."), note(knows_what_when(row.news for row in summary.reactions))]


def _pictures(summary: BatchSummary) -> list[str]:
    # A map is a point, as it is in the interval: seeds of one map are no sample of maps.
    groups: dict[str, dict[str, list[float]]] = {}
    for row in summary.maps:
        if row.vss_pct is not None:
            groups.setdefault(row.scenario, {}).setdefault(row.variant, []).append(row.vss_pct)
    seeds = ", the mean over its seeds" if len(summary.seeds) > 1 else ""
    return [heading("VSS over maps"), figure(over_maps(groups, "VSS [% of the stochastic plan]"),
            f"Each dot is a map{seeds}; the tick is the mean over maps. Right of zero, planning for failures pays.")
            ] if groups else []


def _answer(summary: BatchSummary) -> str:
    """What a batch comes to without reaction, which is said where teams react too; one map tells nothing either way."""
    said, rows = _over_maps(summary.aggregate), summary.aggregate
    told = summary.reactions and any(row.maps > 1 for row in rows)
    return f"If the team keeps its plan, {said[0].lower()}{said[1:]}" if told else said


def _answered(summary: BatchSummary) -> str:
    """What it comes to where teams react; nothing where none does."""
    lines = "".join(f"<li><b>{sentence(answer.condition)}</b> {sentence(' '.join(answer.sentences))}</li>"
                    for answer in answers_over_maps(summary.reactions))
    return f"<ul>{lines}</ul>" if lines else ""


def _over_maps(rows: Sequence[OverMaps]) -> str:
    """What a batch comes to, in one sentence."""
    if rows and all(row.maps == 1 for row in rows):
        return "One map can't tell what planning for failures is worth over maps; below is its worth on this one."
    # The interval that is shown is the one that the verdict rests on.
    pays = [f"{row.label} (VSS {with_interval(row.vss)})" for row in rows if row.vss.ci95 and row.vss.ci95[0] > 0]
    return f"Over these maps planning for failures pays in {listed(pays)}." if pays else \
        "Over these maps no scenario shows a value of planning for failures beyond doubt."
