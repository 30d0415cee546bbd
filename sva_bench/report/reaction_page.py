"""What reacting is worth, on the page of a run."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary
from sva_bench.report.compared_reactions import given_answers, given_reacting
from sva_bench.report.page import heading, note, sentence, table, text
from sva_bench.report.reaction_charts import recourse_by_plan, vss_against_news
from sva_bench.report.reaction_shares import (
    doubted,
    lead_of,
    leads,
    recourse_pct,
    tell,
    value_without,
    vss_pct,
    without_pct,
)
from sva_bench.report.reaction_wording import (
    Answer,
    AnyReacting,
    Reacting,
    assumptions_of,
    definitions,
    doubles,
    reacting,
    reaction_answers,
)
from sva_bench.report.told_columns import NOTHING, difference, told_columns
from sva_bench.report.wording import DOUBTED, adjusted, with_interval


def _rows(summary: AnySummary) -> Sequence[AnyReacting]:
    return given_reacting(summary) if isinstance(summary, ComparisonSummary) else reacting(summary)


def _answers(summary: AnySummary) -> list[Answer]:
    return given_answers(summary) if isinstance(summary, ComparisonSummary) else reaction_answers(summary)


def reactions_answered(summary: AnySummary) -> list[str]:
    """The answers that belong on top of the page; none where nobody reacts."""
    answers = _answers(summary)
    if not answers:
        return []
    return ["<div class=answer><p>What if the robots re-plan?</p>",
            f"<ul>{''.join(map(_answered, answers))}</ul>", "</div>"]


def _answered(answer: Answer) -> str:
    return f"<li><b>{sentence(answer.condition)}</b> {sentence(answer.sentences[0])}</li>"


def _answered_further(answers: Sequence[Answer]) -> str:
    """What else each policy and news come to, of which the first sentence stands on top of the page."""
    items = "".join(f"<li><b>{sentence(answer.condition.rstrip(','))}:</b><ul>"
                    f"{''.join(f'<li>{sentence(said)}</li>' for said in answer.sentences[1:])}</ul></li>"
                    for answer in answers if len(answer.sentences) > 1)
    return f"<ul>{items}</ul>" if items else ""


def reaction_section(summary: AnySummary) -> list[str]:
    """Charts, tables and the meaning of their figures; none where nobody reacts."""
    if not _rows(summary):
        return []
    units = f"In the world file's units, 95 % intervals in brackets; {DOUBTED}: not distinguishable from zero. " \
            "The missions counted here were played with the reaction and without, and all figures are by them; the " \
            "tables on top are by the trials of the run, so theirs may differ. VSS in per cent: of the stochastic " \
            "plan's value with the reaction, or without where nobody reacts."
    rests = [_answered_further(_answers(summary)), *(note(said) for said in assumptions_of(_rows(summary)))]
    if isinstance(summary, ComparisonSummary):
        return [heading("What reacting is worth"), *rests, *_recourse_charts(given_reacting(summary)), _pairs(summary),
                _plans(given_reacting(summary)), note(units),
                *_candidates(given_reacting(summary), "the plans given")]
    rows = reacting(summary)
    return [heading("What reacting is worth"), *rests, *_charts(rows), _values(rows), _plans(rows), note(units),
            *_candidates(rows, "the two plans"), _meanings(rows)]


def _pairs(summary: ComparisonSummary) -> str:
    """Every pair of given plans under each reaction; nothing where only one was given."""
    caption = "Differences with the reaction, by the same failures and noise"
    rows = given_reacting(summary)
    several = any(len(reaction.comparisons) > 1 for _, reaction in rows)
    head = ["plans", "difference", "reaction", *(["by itself"] if several else [])]
    cells = [[f"{c.a} − {c.b}", adjusted(c), reaction.name, with_interval(c)][:len(head)]
             for _, reaction in rows for c in reaction.comparisons]
    return table(head, cells, words=(0, 2), caption=caption, sections=[
        scenario.name for scenario, reaction in rows for _ in reaction.comparisons]) if cells else ""


def reaction_ledgers(summary: AnySummary) -> list[str]:
    """The way from promise to execution of each plan whose team reacts; none where nobody does."""
    rows = _rows(summary)
    if not rows:
        return []
    head = ["plan", "news", "promised", "assumption", "reaction", "draws", "out of fuel", "late", "stuck", "executed"]
    cells = [[name, reaction.news, f"{plan.ledger.promised:.1f}", *(difference(entry) for entry in (
        plan.ledger.assumption, plan.ledger.reaction, plan.ledger.draws, plan.ledger.out_of_fuel, plan.ledger.late,
        plan.ledger.stuck)), with_interval(plan.executed)]
        for _, reaction in rows for name, plan in reaction.plans.items()]
    shown, told = told_columns(head, cells, (0, 1, 2, 4, 9))
    return [table(shown, told, words=(0, 1), caption=f"With the reaction ({_policies(rows)})",
                  sections=[scenario.name for scenario, reaction in rows for _ in reaction.plans]),
            note("Reaction: what re-planning gained or lost. No draws where all histories were played. The promise of "
                 "an anticipative plan has the reaction in it, which the assumption takes out again. "
                 f"{NOTHING}: nothing; columns of nothing else are left out.")]


def _policies(rows: Sequence[AnyReacting]) -> str:
    return "policy " + ", ".join(dict.fromkeys(row.reaction.policy for row in rows))


def _charts(rows: Sequence[Reacting]) -> list[str]:
    parts: list[str] = []
    for policy in dict.fromkeys(row.reaction.policy for row in rows):
        mine = [row for row in rows if row.reaction.policy == policy]
        parts += [vss_against_news(mine, f"VSS by when the team hears of a failure, policy {policy}. Above zero the "
                                         "stochastic plan is worth more, below it the deterministic one. The news "
                                         "comes earlier from left to right; hollow: nobody reacts."),
                  *_recourse_charts(mine)]
    return parts


def _recourse_charts(rows: Sequence[AnyReacting]) -> list[str]:
    """What reacting adds to each plan, a chart for each policy."""
    return [recourse_by_plan([row for row in rows if row.reaction.policy == policy],
                             f"What reacting adds, policy {policy}. Above zero the plan gains by the reaction. A plan "
                             "that loses much by failures has much to gain.")
            for policy in dict.fromkeys(row.reaction.policy for row in rows)]


def _values(rows: Sequence[Reacting]) -> str:
    """VSS against news, and what the best plan adds."""
    head = ["news", "VSS", "VSS [%]", "best plan", "its lead", "next best", "VSS with recourse", "anticipation"]
    cells: list[list[str]] = []
    sections: list[str] = []
    for number, (scenario, reaction) in enumerate(rows):
        if not number or rows[number - 1].scenario is not scenario:
            cells.append(["no reaction", *_vss(
                reaction, reaction.vss_without_reaction, without_pct(reaction)), *[""] * 5])
        cells.append([reaction.news, *_vss(reaction, reaction.vss.executed, vss_pct(reaction)), *_best(reaction),
                      doubted(reaction.vss_with_recourse), doubted(reaction.anticipation)])
        sections += [scenario.name] * (len(cells) - len(sections))
    return table(head, cells, words=(0, 3, 5), sections=sections, caption="Value of planning for failures by when the "
                                                                         f"team hears of one ({_policies(rows)})")


def _best(reaction: ReactionResult) -> list[str]:
    """The best plan tried, its lead, and the next best; which is best isn't told where that is not distinguishable."""
    best = reaction.best
    if best.over is None or best.ci95 == (0.0, 0.0):
        return ["all the same" if best.over is None else "as good as each other", "", ""]
    if not leads(reaction):
        return ["not distinguishable", doubted(lead_of(reaction)), ""]
    return [best.plan, doubted(lead_of(reaction)), best.over]


def _vss(reaction: ReactionResult, found: Estimate, pct: Estimate | None) -> tuple[str, str]:
    return ("the same plan", "") if reaction.vss.same_plan else _difference(found, pct)


def _difference(found: Estimate, pct: Estimate | None) -> tuple[str, str]:
    """A difference with its interval, and in per cent; a dash where that would tell nothing."""
    return doubted(found), doubted(pct, lambda shown: f"{shown.mean:.1f}") if tell([pct]) else "–"


def _plans(rows: Sequence[AnyReacting]) -> str:
    """Each plan with the reaction and without."""
    twice = bool(doubles(rows))
    several, mixed = (len(found) > 1 for found in (
        {reaction.news for _, reaction in rows}, {reaction.histories for _, reaction in rows}))
    head = ["plan", *(["news"] if several else []), "value of recourse", "of its value without [%]", "with it",
            "without reaction", "orders changed [% of missions]",
            *(["doubled visits [per mission]"] if twice else []), "missions played", *(["histories"] if mixed else [])]
    cells = [[name, *([reaction.news] if several else []),
              *_difference(reaction.value_of_recourse[name], recourse_pct(reaction, name)),
              with_interval(plan.executed), f"{value_without(reaction, name):.1f}", f"{100 * plan.reacted:.1f}",
              *([f"{plan.doubled:.3g}"] if twice else []), str(plan.missions), *([reaction.histories] if mixed else [])]
             for _, reaction in rows for name, plan in reaction.plans.items()]
    words = [0, *([1] if several else []), *([len(head) - 1] if mixed else [])]
    return table(head, cells, words=words, caption="Each plan with the reaction",
                 sections=[scenario.name for scenario, reaction in rows for _ in reaction.plans])


def _candidates(rows: Sequence[AnyReacting], ours: str) -> list[str]:
    """What the anticipative plan was chosen from, ``ours`` among them; nothing where none was made."""
    columns = list(dict.fromkeys(reaction.name for _, reaction in rows if reaction.candidates))
    found: dict[tuple[str, str, str], dict[str, str]] = {}
    for scenario, reaction in rows:
        for tried in reaction.candidates:
            exponent = "" if tried.theta is None else f"{tried.theta:g}"
            found.setdefault((scenario.name, tried.plan, exponent), {})[reaction.name] = f"{tried.modelled:.1f}"
    cells = [[*key, *(values.get(name, "") for name in columns)] for key, values in found.items()]
    return [table(["scenario", "candidate", "exponent", *(f"V, {name}" for name in columns)], cells, words=(0, 1),
                  caption=f"Plans that the anticipative one was chosen from: {ours}, and those optimal for "
                          "survival to the power of an exponent; V if all legs are driven as planned")] if cells else []


def _meanings(rows: Sequence[Reacting]) -> str:
    items = "".join(f"<li><b>{text(name)}</b>: {sentence(meaning)}</li>" for name, meaning in definitions(rows))
    return f"<p>What each figure is:</p><ul>{items}</ul>"
