"""The page of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sva_bench.analysis.over_maps import BatchSummary, Percentage, labelled
from sva_bench.analysis.reach import maps_without_reach
from sva_bench.files.printable import counted
from sva_bench.report.calibration_over_maps import calibrated_over_maps
from sva_bench.report.calibration_page import MET, MISSED, bad_pct
from sva_bench.report.compared_values import compared_answers, compared_notes, compared_title, values_table
from sva_bench.report.page import CONTENTS, command, details, figure, heading, note, sentence, table, write_page
from sva_bench.report.reaction_shares import doubted
from sva_bench.report.reaction_wording import knows_what_when
from sva_bench.report.reactions_over_maps import answers_over_maps, reaction_table
from sva_bench.report.response_chart import response, vss_responses
from sva_bench.report.results_charts import over_maps
from sva_bench.report.run_answer import facts
from sva_bench.report.variant_names import VariantNames
from sva_bench.report.vss_over_maps import headline_over_maps, verdicts_of
from sva_bench.report.wording import (
    DOUBTED,
    DOUBTED_TOLD,
    VSS_PCT,
    optional,
    over_few_maps,
    percentage,
    same_draws,
    vss_verdict,
    with_interval,
)


def write_batch_report(path: Path, summary: BatchSummary, command: Sequence[str] = ()) -> None:
    """Write the ``report.html`` of a batch.

    Args:
        path: Where to.
        summary: Its summary.
        command: The command line that began it, where that is known.
    """
    names = VariantNames(summary)
    failed = [[entry.unit, entry.world, str(entry.seed), entry.reason] for entry in summary.failed]
    parts = [
        f"<h1>Value of the stochastic solution over {counted(len(summary.worlds), 'map')}</h1>",
        *_answer(summary, names),
        _main_table(summary, names),
        note(f"{DOUBTED_TOLD} {VSS_PCT} {counted(summary.trials, 'trial')} of each plan in each scenario, fidelity "
             f"{summary.fidelity}; 95 % intervals in brackets. Over maps, the maps are the sample. "
             f"{same_draws(summary)}".rstrip()),
        CONTENTS,
        *_compared(summary),
        *_reactions(summary, names),
        *(note(remark) for remark in maps_without_reach([
            names.labelled(unit.world, unit.variant) for unit in summary.units if unit.reach.nothing])),
        *([heading("Given up"), table(["unit", "map", "seed", "reason"], failed, words=(0, 1, 3))] if failed else []),
        *_pictures(summary, names),
        heading("Map by map"),
        table(["scenario", "VSS", "VSS [%]", "stochastic", "deterministic", "VSS, modelled", "EVPI", "seed"],
              [[s.name, vss_verdict(s.vss), "" if s.vss.executed_pct is None else f"{s.vss.executed_pct:.1f}",
                *(with_interval(plan.executed) for plan in (s.stochastic, s.deterministic)),
                f"{s.vss.modelled:.1f}", optional(s.evpi), str(unit.seed)]
               for unit in summary.units for s in unit.scenarios],
              sections=[names.labelled(unit.world, unit.variant) for unit in summary.units for _ in unit.scenarios]),
        *_calibrated(summary, names),
        *_again(summary, command),
    ]
    write_page(path, f"VSS over {counted(len(summary.worlds), 'map')}", parts)


def _answer(summary: BatchSummary, names: VariantNames) -> list[str]:
    """What it comes to: a headline, where it varies a line for each scenario, and how far to trust it."""
    rows, told = summary.aggregate, list[tuple[str, str]]()
    if any(summary.variants) and any(row.maps > 1 for row in rows):
        told += [(scenario, verdicts_of([row for row in rows if row.scenario == scenario], names.short))
                 for scenario in dict.fromkeys(row.scenario for row in rows)]
        told += [("Varied", ", ".join(names.keys))] if names.keys else []
    if caution := over_few_maps(rows):
        told.append(("Caution", caution))
    answers = "".join(f"<li><b>{sentence(answer.condition)}</b> {sentence(' '.join(answer.sentences))}</li>"
                      for answer in answers_over_maps(summary.reactions))
    return [f"<div class=answer><p>{sentence(headline_over_maps(summary))}</p>", facts(iter(told)),
            f"<ul>{answers}</ul>" if answers else "", "</div>"]


def _main_table(summary: BatchSummary, names: VariantNames) -> str:
    """VSS over maps; where settings vary, a row for each variant, below its scenario."""
    rows, varied = summary.aggregate, any(summary.variants)
    if varied:
        order = {name: number for number, name in enumerate(dict.fromkeys(row.scenario for row in rows))}
        rows = tuple(sorted(rows, key=lambda row: order[row.scenario]))
    counts = len({row.maps for row in rows}) > 1
    head = ["variant" if varied else "scenario", "VSS", "VSS [%]", *(["maps"] if counts else [])]
    cells = [[names.short(row.variant) if varied else row.scenario, doubted(row.vss), _share(row.vss_pct),
              str(row.maps)][:len(head)] for row in rows]
    return table(head, cells, sections=[row.scenario for row in rows] if varied else (),
                 caption=f"VSS over maps, by {', '.join(names.keys)}" if names.keys else "")


def _share(found: Percentage) -> str:
    """In per cent, marked where that is not distinguishable from zero: its interval is another than in incentive."""
    if found.mean is None or found.ci95 is None or found.ci95 == (0.0, 0.0) or not found.ci95[0] <= 0 <= found.ci95[1]:
        return percentage(found)
    return percentage(found).replace(" [", f"{DOUBTED} [", 1)


def _again(summary: BatchSummary, command_line: Sequence[str]) -> list[str]:
    versions = "The worlds with all their variants, and all options, stand in manifest.json, the figures in " \
               "summary.json, every trial in the outcomes-*.parquet."
    seeds = f"{counted(len(summary.seeds), 'seed')}: {', '.join(map(str, summary.seeds[:_MOST_SEEDS]))}" + (
        ", ..." if len(summary.seeds) > _MOST_SEEDS else "")
    return [heading("How to get the same again"), *([command(command_line)] if command_line else []),
            note(f"{seeds}. {versions}")]


_MOST_SEEDS = 12


def _calibrated(summary: BatchSummary, names: VariantNames) -> list[str]:
    """How often calibrated plans go wrong and what they are worth, map by map."""
    rows = [[s.name, MET if found.reached else MISSED, bad_pct(found.bad), bad_pct(found.nominal.bad),
             with_interval(s.plans["calibrated"].executed), with_interval(s.stochastic.executed),
             f"{found.promised:.1f}", f"{found.nominal.promised:.1f}", found.chosen.name, str(unit.seed)]
            for unit in summary.units for s in unit.scenarios if (found := s.calibration) is not None]
    if not rows:
        return []
    what_for, *lines = calibrated_over_maps(summary.units)
    return [heading("Calibrated plans"), f"<p>{sentence(what_for)}</p>",
            f"<ul>{''.join(f'<li>{sentence(line)}</li>' for line in lines)}</ul>",
            table(["scenario", "share", "go wrong", "go wrong, nominal", "executed", "executed, nominal", "promised",
                   "promised, nominal", "made for costs at", "seed"],
                  rows, words=(0, 1, 8), sections=[
                      names.labelled(unit.world, unit.variant) for unit in summary.units for s in unit.scenarios
                      if s.calibration is not None],
                  caption="Each plan beside the nominal one, which is the stochastic one. Missions go wrong by the "
                          "twin, under draws of its own; a plan that missed its share is shown, and not calibrated")]


_MEANS = "Executed value of the stochastic plan: means, each with its own 95 % interval."
_DIFFERENCES = "Paired differences: intervals that hold together with 95 %. What both values share cancels, so a " \
    "difference may be clear of zero though the intervals of the means overlap."


def _compared(summary: BatchSummary) -> list[str]:
    """What the values of varied keys are worth."""
    if not summary.compared:
        return []
    parts = [heading("Which value is worth more?")]
    for found in summary.compared:
        head, cells = values_table(found)
        parts += [f"<ul>{''.join(f'<li>{sentence(said)}</li>' for said in compared_answers(found))}</ul>",
                  response(found, _MEANS), response(found, _DIFFERENCES, more=True),
                  table(head, cells, caption=compared_title(found),
                        sections=[labelled(row.scenario, row.others) for row in found.rows])]
    return [*parts, *map(note, compared_notes(summary.compared))]


def _reactions(summary: BatchSummary, names: VariantNames) -> list[str]:
    """What teams that react make of it."""
    if not summary.reactions:
        return []
    head, words, cells = reaction_table(summary.reactions, narrow=False)
    if any(row.variant for row in summary.reactions):  # which is said above its rows
        head, words, cells = head[1:], words[:-1], [cell[1:] for cell in cells]
    return [heading("Teams that react"), table(head, cells, words=words, sections=[
        names.whole(row.variant) for row in summary.reactions] if any(summary.variants) else ()), note(
        "VSS: stochastic less deterministic plan under the reaction, of either sign. Recourse: what reacting adds to a "
        "plan. In per cent: VSS of the stochastic plan's value, recourse of the plan's value without reaction. VSS "
        "with recourse and anticipation: the best plan for the reaction less the deterministic and the "
        "stochastic one."), note(knows_what_when(row.news for row in summary.reactions))]


def _pictures(summary: BatchSummary, names: VariantNames) -> list[str]:
    # A map is a point, as it is in the interval: seeds of one map are no sample of maps.
    groups: dict[str, dict[str, list[float]]] = {}
    for row in summary.maps:
        if row.vss_pct is not None:
            groups.setdefault(row.scenario, {}).setdefault(names.short(row.variant), []).append(row.vss_pct)
    seeds = ", the mean over its seeds" if len(summary.seeds) > 1 else ""
    varied = f" Varied: {', '.join(names.keys)}." if names.keys else ""
    if not groups:
        return []
    responses = vss_responses(summary, names)
    dots = figure(over_maps(groups, "VSS [% of the stochastic plan]"), f"Each dot is a map{seeds}; the tick is the "
                  f"mean over maps. Right of zero, planning for failures pays.{varied}")
    return [heading("VSS over maps"), *responses, details("Each map by itself", dots) if responses else dots]
