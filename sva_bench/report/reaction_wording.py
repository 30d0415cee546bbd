"""Texts of teams that react, shared by terminal and page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from sva_bench.analysis.reaction_results import ComparedReaction, Gain, ReactionFigures, ReactionResult
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import Summary
from sva_bench.choices import News, PolicyName
from sva_bench.files.printable import counted
from sva_bench.report.reaction_shares import MOST_PER_CENT, difference_pct, lead_of, leads
from sva_bench.report.wording import listed, per_cent

_MOST_NAMED = 6

_DOES: dict[PolicyName, str] = {"resolve": "re-plans", "none": "keeps its orders"}
_HEARS: dict[News, str] = {
    "never": "on news of failures but never has any", "station": "at the stations where robots hear of a failure",
    "report": "when a robot misses a report", "instant": "the moment a robot fails"}
KNOWS: dict[News, str] = {
    "never": "nobody ever learns of a failure",
    "station": "a failure is posted when its report is missed, each robot learns of it when it next leaves a station, "
               "and stations share what robots decided",
    "report": "all robots learn of a failure at the planned arrival that the robot misses, or at the failure if that "
              "is later",
    "instant": "all robots learn of a failure the moment it happens"}
"""Who knows what when, by the kind of news."""


class Answer(NamedTuple):
    """What a policy and news come to: the condition, and what holds under it, sentence by sentence.

    Joined by spaces, all of it reads as a text.
    """

    condition: str
    sentences: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join((self.condition, *self.sentences))


class Reacting(NamedTuple):
    """A scenario under one policy and news."""

    scenario: ScenarioSummary
    reaction: ReactionResult


class GivenReacting(NamedTuple):
    """The same of plans that were given."""

    scenario: ComparedScenario
    reaction: ComparedReaction


AnyReacting = Reacting | GivenReacting


def reacting(summary: Summary) -> list[Reacting]:
    """Every scenario under every policy and news, scenario by scenario."""
    return [Reacting(scenario, reaction) for scenario in summary.scenarios for reaction in scenario.reactions or ()]


def reaction_answers(summary: Summary) -> list[Answer]:
    """What planning for failures is worth to a team that re-plans: an answer for each policy and news.

    News that come to the same, in the digits shown, share an answer; no news has its own.
    """
    found: dict[tuple[PolicyName, bool, tuple[str, ...]], list[News]] = {}
    for policy, news in dict.fromkeys((row.reaction.policy, row.reaction.news) for row in reacting(summary)):
        rows = [row for row in reacting(summary) if (row.reaction.policy, row.reaction.news) == (policy, news)]
        said = tuple(part for part in (_worth(rows), _recourse(rows), _best(rows), _nothing_made(rows)) if part)
        found.setdefault((policy, news == "never", said), []).append(news)
    return [Answer(condition(policy, news), said) for (policy, _, said), news in found.items()]


def condition(policy: PolicyName, news: Sequence[News]) -> str:
    """Under which something is said: what the team does, and when."""
    return f"If the team {_DOES[policy]} {', or '.join(_HEARS[own] for own in news)},"


def reaction_assumptions(summary: Summary) -> list[str]:
    """What the answers rest on: who knows what when, what re-planning is, and whether failures were sampled."""
    return assumptions_of(reacting(summary))


def assumptions_of(rows: Sequence[AnyReacting]) -> list[str]:
    """What answers about these rest on."""
    if not rows:
        return []
    tried = "" if any("anticipative" in row.reaction.plans for row in rows) else \
        " --anticipate makes a plan for the reaction and compares it with those given." \
        if isinstance(rows[0], GivenReacting) else \
        " No plan was made for the reaction; --anticipate makes one and tries it too."
    return [knows_what_when(row.reaction.news for row in rows),
            f"{_histories(rows)}{_driven_whole(rows)}{tried}"]


def knows_what_when(news: Iterable[News]) -> str:
    """Who is taken to know what when, for some kinds of news."""
    told = "; ".join(f"{own} news: {KNOWS[own]}" for own in dict.fromkeys(news))
    return f"Who knows what when: {told}. The team counts on its schedule, and on reports of robots that run late; a " \
           "leg is driven to its end before new orders are taken, so a robot on its last leg home, or home, is told " \
           "nothing more."


def _driven_whole(rows: Sequence[AnyReacting]) -> str:
    """The check of missions put together from legs; nothing where there was none."""
    missions = sum(row.reaction.driven_whole.missions for row in rows)
    differing = sum(row.reaction.driven_whole.differing for row in rows)
    if not missions:
        return ""
    found = "none ended otherwise" if not differing else f"{differing} ended otherwise"
    return f" Legs were driven one by one; as a check {counted(missions, 'mission')} with changed orders " \
           f"{'was' if missions == 1 else 'were'} driven whole in physics: {found}."


def _histories(rows: Sequence[AnyReacting]) -> str:
    least, most = (extreme(plan.missions for row in rows for plan in row.reaction.plans.values())
                   for extreme in (min, max))
    number = f"{least} to {counted(most, 'mission')}" if least < most else counted(most, "mission")
    kinds = {row.reaction.histories for row in rows}
    if kinds == {"enumerated"}:
        return f"With reactions all histories of failures were played under each noise draw ({number} a plan): the " \
               "interval is that of the noise alone."
    if kinds == {"sampled"}:
        return f"With reactions {number} were played of each plan, a sample of the histories of failures: the " \
               "interval is that of failures and noise."
    return "With reactions all histories of failures were played where they are few, else a sample of them " \
           f"({number} a plan)."


def _worth(rows: Sequence[Reacting]) -> str:
    """Value of planning for failures under the reaction, beside that without."""
    pays, loses, even, zero, same, unsure = _sorted_by_verdict(rows)
    said = []
    if pays:
        said.append("planning for failures is worth " + few_of(
            [f"{_amount_of_vss(row.reaction)} in {row.scenario.name} ({_without(row)})" for row in pays]))
    if loses:
        said.append("the deterministic plan is worth more in " + few_of(
            [f"{row.scenario.name} (VSS {_amount_of_vss(row.reaction)}; {_without(row)})" for row in loses]))
    if even:
        said.append("the value of planning for failures is not distinguishable from zero in " + few_of(
            [row.scenario.name + _where_uneven(row) for row in even]))
    if idle := [s.name for s, r in zero if _is_worthless(r)]:
        said.append(f"every plan is worth exactly nothing in {few_of(idle)}, whether the team reacts or not")
    if level := [row.scenario.name + _where_uneven(row) for row in zero if not _is_worthless(row.reaction)]:
        said.append(f"both plans are worth exactly the same in {few_of(level)}")
    if unsure:
        said.append("too few noise draws give an interval in " + few_of([s.name for s, _ in unsure]))
    if same:
        said.append("both plans are the same in " + few_of([s.name for s, _ in same]))
    return "; ".join(said) + "."


def _sorted_by_verdict(rows: Sequence[Reacting]) -> tuple[list[Reacting], ...]:
    pays: list[Reacting] = []
    loses: list[Reacting] = []
    even: list[Reacting] = []
    zero: list[Reacting] = []
    same: list[Reacting] = []
    unsure: list[Reacting] = []
    for row in rows:
        vss = row.reaction.vss
        if _is_worthless(row.reaction):
            zero.append(row)
        elif vss.same_plan:
            same.append(row)
        elif vss.executed.ci95 is None:
            unsure.append(row)
        elif vss.executed.ci95 == (0.0, 0.0):
            zero.append(row)
        elif not vss.distinguishable:
            even.append(row)
        else:
            (pays if vss.executed.mean > 0 else loses).append(row)
    return pays, loses, even, zero, same, unsure


def _is_worthless(reaction: ReactionFigures) -> bool:
    """Whether every plan is worth nothing with certainty, with the reaction and without."""
    return all(own == Estimate(mean=0.0, ci95=(0.0, 0.0)) for own in (
        *(Estimate(mean=plan.executed.mean, ci95=plan.executed.ci95) for plan in reaction.plans.values()),
        *(Estimate(mean=gain.mean, ci95=gain.ci95) for gain in reaction.value_of_recourse.values())))


def _without(row: Reacting) -> str:
    """What is to be said of the VSS without reaction, behind that with it."""
    scenario, reaction = row
    found = reaction.vss_without_reaction
    if not found.excludes_zero:
        return f"in place of {amount(found)}, which has no interval" if found.ci95 is None else \
            "in place of nothing" if found.ci95 == (0.0, 0.0) else "without reaction not distinguishable from zero"
    if amount(found) != _amount_of_vss(reaction):
        return _told_without(row)
    return "as without reaction" + ("" if _is_the_runs(scenario, reaction) else _ANOTHER.format(
        "all histories" if reaction.histories == "enumerated" else "the missions played",
        amount(_of_the_run(scenario))))


def _told_without(row: Reacting) -> str:
    """The VSS without reaction. The run's own trials, which other failures were drawn for, may give another one."""
    same = "" if _is_the_runs(*row) else " in the same missions"
    return f"in place of {amount(row.reaction.vss_without_reaction)}{same}"


def _is_the_runs(scenario: ScenarioSummary, reaction: ReactionResult) -> bool:
    """Whether the VSS without reaction, as it is shown, is the figure that the run's own trials gave."""
    return amount(reaction.vss_without_reaction) == amount(_of_the_run(scenario))


def _of_the_run(scenario: ScenarioSummary) -> Gain:
    vss = scenario.vss
    return Gain(mean=vss.executed.mean, ci95=vss.executed.ci95, pct=vss.executed_pct)


_ANOTHER = "; that is over {}, the trials drawn gave {}"


def _where_uneven(row: Reacting) -> str:
    """The VSS without reaction where that is another than none, in brackets."""
    return f" ({_told_without(row)})" if row.reaction.vss_without_reaction.excludes_zero else ""


def _amount_of_vss(reaction: ReactionResult) -> str:
    vss = reaction.vss
    return amount(Gain(mean=vss.executed.mean, ci95=vss.executed.ci95, pct=vss.executed_pct))


def amount(gain: Gain) -> str:
    """A difference in per cent; in incentive where there is no percentage, or an absurd one."""
    if gain.pct is None or abs(gain.pct) > MOST_PER_CENT:
        return f"{gain.mean:.1f} of incentive"
    return per_cent(gain.pct)


def _recourse(rows: Sequence[Reacting]) -> str:
    """What re-planning adds to each of the two plans."""
    gains = [(s.name, r.value_of_recourse["deterministic"], r.value_of_recourse["stochastic"]) for s, r in rows]
    telling = [row for row in gains if row[1].excludes_zero or row[2].excludes_zero]
    if not telling:
        changed_at_all = any(gain.ci95 != (0.0, 0.0) for _, *both in gains for gain in both)
        return f"Re-planning changes no plan's value{' distinguishably' if changed_at_all else ''}."
    falls = any(gain.excludes_zero and gain.mean < 0 for _, *both in telling for gain in both)
    (name, det, sto), *more = telling
    first = f"the deterministic plan by {gained(det)} and the stochastic one by {gained(sto)} in {name}" if falls \
        else f"{gained(det)} to the deterministic plan and {gained(sto)} to the stochastic one in {name}"
    others = [f"{gained(det)} and {gained(sto)} in {name}" for name, det, sto in more]
    return f"Re-planning {'changes' if falls else 'adds'} {few_of([first, *others], '; ')}."


def gained(gain: Gain) -> str:
    """What reacting adds to a plan, in words."""
    if not gain.excludes_zero:
        return "nothing" if gain.ci95 == (0.0, 0.0) else "nothing distinguishable"
    return amount(gain)


def _best(rows: Sequence[Reacting]) -> str:
    """Which of the plans tried is the best for the reaction, and by how much; none is where none leads."""
    told = [(s, r) for s, r in rows if r.best.over is not None and not _is_worthless(r)]
    said = [f"{_level(r)} in {s.name}" if r.best.ci95 == (0.0, 0.0) else f"the {r.best.plan} in {s.name} ({lead(r)})"
            for s, r in told if r.best.ci95 == (0.0, 0.0) or leads(r)]
    even = [s.name for s, r in told if r.best.ci95 not in ((0.0, 0.0), None) and not leads(r)]
    return " ".join([*([f"The best plan for it, of those tried: {few_of(said)}."] if said else []),
                     *([f"Which plan is best for it is not distinguishable in {few_of(even)}."] if even else [])])


def _level(reaction: ReactionResult) -> str:
    """The best plan and the next where they are worth exactly the same."""
    best = reaction.best
    return "both" if {best.plan, best.over} == {"stochastic", "deterministic"} else \
        f"the {best.plan} and the {best.over} alike"


def _nothing_made(rows: Sequence[Reacting]) -> str:
    """Where the plan made for the reaction is one of the two plans."""
    said = [f"the {r.best.plan} in {s.name}" for s, r in rows
            if "anticipative" in r.plans and r.best.plan != "anticipative" and not _is_worthless(r)]
    return f"No plan made for it is better than the two: the anticipative plan is {few_of(said)}." if said else ""


def lead(reaction: ReactionResult) -> str:
    """How far the best plan is ahead of the next, of which it is said that it is distinguishable."""
    best = reaction.best
    pct = difference_pct(reaction, lead_of(reaction))
    told = f"{best.mean:+.1f} of incentive" if pct is None or pct.mean > MOST_PER_CENT else f"+{per_cent(pct.mean)}"
    return f"{told} over the {best.over}"


def few_of(words: Sequence[str], comma: str = ", ") -> str:
    """As many as a sentence bears, and how many more there are."""
    kept = [*words[:_MOST_NAMED], *([f"{len(words) - _MOST_NAMED} more below"] if len(words) > _MOST_NAMED else [])]
    return listed(kept) if comma == ", " else comma.join(kept)


def doubles(rows: Iterable[AnyReacting]) -> list[str]:
    """Scenarios, news and plans in which two robots visit a POI, if any."""
    return [f"{plan.doubled:.2g} a mission in {s.name} on {r.news} news ({name})"
            for s, r in rows for name, plan in r.plans.items() if plan.doubled > 0]


def changed(reaction: ReactionFigures) -> str:
    """Share of missions in which orders change, over the plans [%]."""
    shares = [100 * plan.reacted for plan in reaction.plans.values()]
    least, most = f"{min(shares):.0f}", f"{max(shares):.0f}"
    return least if least == most else f"{least}–{most}"


DEFINITIONS: tuple[tuple[str, str], ...] = (
    ("V(x, π)", "mean value that plan x collects if the team follows policy π; V(x, none) is that without reaction"),
    ("VSS under π", "V(stochastic, π) − V(deterministic, π), in per cent of V(stochastic, π). Either sign: neither "
     "plan was made for π, and the stochastic plan pays for a hedge that re-planning may give for nothing"),
    ("Value of recourse of x", "V(x, π) − V(x, none), by the same failures and noise, in per cent of V(x, none). What "
     "reacting adds to a plan; below zero where re-planning on what is known then turns out worse"),
    ("Best plan for π", "the plan with the greatest V(x, π) if all legs are driven as planned, of those tried: the two "
     "plans and, with --anticipate, the anticipative one; another plan may be better still. Its lead is over the next "
     "best of other routes, as executed; where that holds zero, which plan is best is not distinguishable"),
    ("VSS with recourse", "V(best, π) − V(deterministic, π): what planning for failures is worth if the plan may be "
     "made for the reaction. Not below zero but for noise, as the deterministic plan is among those tried"),
    ("Anticipation", "V(best, π) − V(stochastic, π): what knowing of the reaction when planning adds to planning for "
     "failures"),
    ("Orders changed", "share of missions in which the orders of some robot change that lives to take them"),
)
"""What each figure is."""


def definitions(rows: Sequence[AnyReacting]) -> Iterator[tuple[str, str]]:
    """Figures with what they are, as far as the tables have them."""
    yield from DEFINITIONS
    if doubles(rows):
        yield "Doubled visits", "mean number of POIs in a mission that two robots visit, both visits counted: the " \
                                "incentive of such a POI is credited twice"
