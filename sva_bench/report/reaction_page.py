"""What reacting is worth, on the page of a run."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.results import Estimate, VssFigures
from sva_bench.analysis.summaries import Summary
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.report.page import figure, heading, note, sentence, table, text
from sva_bench.report.reaction_wording import (
    DOUBTED,
    Answer,
    Reacting,
    definitions,
    doubles,
    doubted,
    lead_pct,
    of_best_pct,
    reacting,
    reaction_answers,
    reaction_assumptions,
    recourse_pct,
    vss_pct,
)
from sva_bench.report.wording import with_interval


def reactions_answered(summary: Summary) -> list[str]:
    """The answers that belong on top of the page; none where nobody reacts."""
    answers = reaction_answers(summary)
    if not answers:
        return []
    return ["<div class=answer><p>What if the robots re-plan?</p>",
            f"<ul>{''.join(map(_answered, answers))}</ul>",
            *(note(said) for said in reaction_assumptions(summary)), "</div>"]


def _answered(answer: Answer) -> str:
    first, *more = answer.sentences
    below = f"<ul>{''.join(f'<li>{sentence(said)}</li>' for said in more)}</ul>" if more else ""
    return f"<li><b>{sentence(answer.condition)}</b> {sentence(first)}{below}</li>"


def reaction_section(summary: Summary) -> list[str]:
    """Charts, tables and the meaning of their figures; none where nobody reacts."""
    rows = reacting(summary)
    if not rows:
        return []
    return [heading("What reacting is worth"), *_charts(rows), _values(rows), _plans(rows),
            note(f"In the world file's units, 95 % intervals in brackets; {DOUBTED}: not distinguishable from zero. "
                 "No reaction: the trials of the table on top. All else: the missions counted here, played with the "
                 "reaction and without."),
            *_candidates(rows), _meanings(rows)]


def reaction_ledgers(summary: Summary) -> list[str]:
    """The way from promise to execution of each plan whose team reacts; none where nobody does."""
    rows = reacting(summary)
    if not rows:
        return []
    head = ["scenario", "news", "plan", "promised", "assumption", "reaction", "draws", "out of fuel", "late", "stuck",
            "executed"]
    cells = [[scenario.name, reaction.news, name, f"{plan.ledger.promised:.1f}", *(f"{entry + 0.0:+.1f}" for entry in (
        plan.ledger.assumption, plan.ledger.reaction, plan.ledger.draws, plan.ledger.out_of_fuel, plan.ledger.late,
        plan.ledger.stuck)), with_interval(plan.executed)]
        for scenario, reaction in rows for name, plan in reaction.plans.items()]
    return [table(head, cells, words=(0, 1, 2), caption=f"With the reaction ({_policies(rows)})"),
            note("Reaction: what re-planning gained or lost. No draws where all histories were played. The promise of "
                 "an anticipative plan has the reaction in it, which the assumption takes out again.")]


def _policies(rows: Sequence[Reacting]) -> str:
    return "policy " + ", ".join(dict.fromkeys(row.reaction.policy for row in rows))


def _charts(rows: Sequence[Reacting]) -> list[str]:
    with holding_back_ctrl_c():
        from sva_bench.report import reaction_charts

    parts = []
    scenarios = len({row.scenario.name for row in rows})
    cut = f" The first {reaction_charts.MOST_SCENARIOS} of {counted(scenarios, 'scenario')}." \
        if scenarios > reaction_charts.MOST_SCENARIOS else ""
    for policy in dict.fromkeys(row.reaction.policy for row in rows):
        mine = [row for row in rows if row.reaction.policy == policy]
        parts += ["<div class=pair>", figure(
            reaction_charts.vss_against_news(mine), "Above zero the stochastic plan is worth more, below it the "
            f"deterministic one. The news comes earlier from left to right.{cut}"), figure(
            reaction_charts.recourse_by_plan(mine), "Right of zero the plan gains by the reaction. A plan that loses "
            f"much by failures has much to gain.{cut}"), "</div>"]
    return parts


def _values(rows: Sequence[Reacting]) -> str:
    """VSS against news, and what the best plan adds."""
    head = ["news", "VSS", "VSS [%]", "VSS with recourse", "VSS with recourse [%]", "anticipation", "anticipation [%]",
            "best plan", "lead", "lead [%]", "next best"]
    cells: list[list[str]] = []
    sections: list[str] = []
    for number, (scenario, reaction) in enumerate(rows):
        if not number or rows[number - 1].scenario is not scenario:
            plain = scenario.stochastic.executed.mean
            cells.append(["no reaction", *_vss(scenario.vss, plain), *[""] * 8])
        ahead = Estimate(mean=reaction.best.mean, ci95=reaction.best.ci95)
        best = [reaction.best.plan, *_difference(ahead, lead_pct(reaction)), reaction.best.over]
        cells.append([
            reaction.news, *_vss(reaction.vss, reaction.plans["stochastic"].executed.mean),
            *_difference(reaction.vss_with_recourse, of_best_pct(reaction, reaction.vss_with_recourse)),
            *_difference(reaction.anticipation, of_best_pct(reaction, reaction.anticipation)),
            *(["all the same", "", "", ""] if reaction.best.over is None else [str(word) for word in best])])
        sections += [scenario.name] * (len(cells) - len(sections))
    return table(head, cells, words=(0, 7, 10), sections=sections, caption="Value of planning for failures by when the "
                                                                          f"team hears of one ({_policies(rows)})")


def _vss(vss: VssFigures, stochastic: float) -> tuple[str, str]:
    return ("the same plan", "") if vss.same_plan else _difference(vss.executed, vss_pct(vss, stochastic))


def _difference(found: Estimate, pct: Estimate | None) -> tuple[str, str]:
    """A difference with its interval, and in per cent."""
    return doubted(found), doubted(pct, lambda shown: f"{shown.mean:.1f}")


def _plans(rows: Sequence[Reacting]) -> str:
    """Each plan with the reaction and without."""
    twice = bool(doubles(rows))
    head = ["news", "plan", "without reaction", "with it", "value of recourse", "value of recourse [%]",
            "orders changed [% of missions]", *(["doubled visits [per mission]"] if twice else []), "missions played",
            "histories"]
    cells = [[reaction.news, name, f"{plan.executed.mean - reaction.value_of_recourse[name].mean:.1f}",
              with_interval(plan.executed),
              *_difference(reaction.value_of_recourse[name], recourse_pct(reaction, name)),
              f"{100 * plan.reacted:.1f}", *([f"{plan.doubled:.3g}"] if twice else []), str(plan.missions),
              reaction.histories]
             for _, reaction in rows for name, plan in reaction.plans.items()]
    return table(head, cells, words=(0, 1, len(head) - 1), caption="Each plan with the reaction",
                 sections=[scenario.name for scenario, reaction in rows for _ in reaction.plans])


def _candidates(rows: Sequence[Reacting]) -> list[str]:
    columns = list(dict.fromkeys(reaction.name for _, reaction in rows if reaction.candidates))
    found: dict[tuple[str, str, str], dict[str, str]] = {}
    for scenario, reaction in rows:
        for tried in reaction.candidates:
            exponent = "" if tried.theta is None else f"{tried.theta:g}"
            found.setdefault((scenario.name, tried.plan, exponent), {})[reaction.name] = f"{tried.modelled:.1f}"
    cells = [[*key, *(values.get(name, "") for name in columns)] for key, values in found.items()]
    return [table(["scenario", "candidate", "exponent", *(f"V, {name}" for name in columns)], cells, words=(0, 1),
                  caption="Plans that the anticipative one was chosen from: the two plans, and those optimal for "
                          "survival to the power of an exponent; V if all legs are driven as planned")] if cells else []


def _meanings(rows: Sequence[Reacting]) -> str:
    items = "".join(f"<li><b>{text(name)}</b>: {sentence(meaning)}</li>" for name, meaning in definitions(rows))
    return f"<p>What each figure is:</p><ul>{items}</ul>"
