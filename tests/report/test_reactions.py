"""What people see of teams that react: on the terminal, on the page, in notebooks and as CSV."""

from __future__ import annotations

import csv
import html
import io
import json
import random
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from sva_bench.analysis.reaction_results import Candidate, ReactionResult
from sva_bench.analysis.reaction_table import REACTION_COLUMNS
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.summaries import Summary
from sva_bench.choices import NEWS
from sva_bench.cli.reaction_table import print_reactions
from sva_bench.files.records import as_dict, from_dict
from sva_bench.report.panels import MOST_PANELS
from sva_bench.report.reaction_page import reaction_ledgers, reaction_section, reactions_answered
from sva_bench.report.reaction_shares import doubted, in_per_cent
from sva_bench.report.reaction_wording import (
    DEFINITIONS,
    KNOWS,
    changed,
    reacting,
    reaction_answers,
    reaction_assumptions,
)
from sva_bench.report.wording import DOUBTED, answer
from sva_bench.storage.stored_run import write_csv
from sva_bench.study.options import Options
from sva_bench.study.publish import Run
from sva_bench.study.run import run
from tests.pages import read, untypeset
from tests.results_for_tests import reaction, summary
from tests.worlds_for_tests import world_of

# The stochastic plan keeps 100 and gains 1 by reacting, the deterministic one 80 and gains 20.
PAYS = {"stochastic": (100.0, 101.0), "deterministic": (80.0, 100.0), "anticipative": (90.0, 104.0)}
MORE = {"stochastic": (100.0, 101.0), "deterministic": (70.0, 90.0)}
LOSES = {"stochastic": (100.0, 101.0), "deterministic": (80.0, 110.0)}


def summary_of(*reactions: ReactionResult, names: tuple[str, ...] = ("S",)) -> Summary:
    """A run in whose scenarios the VSS without reaction is 20 [19, 21], of 100, and these reactions were played."""
    plain = summary((19.0, 21.0), 100.0)
    one = plain.scenarios[0]
    one = replace(one, vss=replace(one.vss, executed_pct=20.0), reactions=reactions or None)
    return replace(plain, scenarios=tuple(replace(one, name=name) for name in names))


def said(found: Summary) -> str:
    return " ".join(map(str, reaction_answers(found)))


def printed(found: Summary, width: int = 100) -> str:
    stream = io.StringIO()
    print_reactions(found, Console(file=stream, width=width, markup=False))
    return stream.getvalue()


def page_of(found: Summary) -> str:
    parts = [*reactions_answered(found), *reaction_section(found), *reaction_ledgers(found)]
    return untypeset(html.unescape("\n".join(parts)))


def test_an_answer_says_what_planning_and_re_planning_are_worth_and_which_plan_is_best() -> None:
    # VSS 101 - 100 = 1, of 101; recourse 20 of 80 and 1 of 100; the best plan leads by 104 - 101 = 3, of 101 too.
    found = summary_of(reaction("report", PAYS, half=0.5, best="anticipative", over="stochastic"))
    assert said(found) == (
        "If the team re-plans when a robot misses a report, planning for failures is worth 1.0 % in S (in place "
        "of 20 %). Re-planning adds 25 % to the deterministic plan and 1.0 % to the stochastic one in S. The best plan "
        "for it, of those tried: the anticipative in S (+3.0 % over the stochastic).")


def test_a_vss_below_zero_is_told_as_the_deterministic_plan_being_worth_more() -> None:
    found = summary_of(reaction("instant", LOSES, half=0.5, best="deterministic", over="stochastic"))
    assert "the deterministic plan is worth more in S (VSS -8.9 %; in place of 20 %)" in said(found)
    assert "planning for failures is worth" not in said(found)


def test_nothing_is_claimed_where_intervals_hold_zero() -> None:
    found = summary_of(reaction("report", PAYS, half=50.0, best="anticipative", over="stochastic"))
    assert said(found) == (
        "If the team re-plans when a robot misses a report, the value of planning for failures is not distinguishable "
        "from zero in S. Re-planning changes no plan's value distinguishably. Which plan is best for it is not "
        "distinguishable in S.")


@pytest.mark.parametrize(("values", "half", "over"), [
    (PAYS, 3.5, "stochastic"), (PAYS, 50.0, "stochastic"),  # ahead by 3, and that is within the noise
    (PAYS | {"anticipative": (90.0, 95.0)}, 0.5, "stochastic"),  # surely behind: noise turned what was found without
])
def test_no_plan_is_named_the_best_whose_lead_is_not_told_from_zero_or_negative(
    values: dict[str, tuple[float, float]], half: float, over: str
) -> None:
    found = summary_of(reaction("report", values, half=half, best="anticipative", over=over))
    assert "The best plan for it" not in said(found)
    assert "Which plan is best for it is not distinguishable in S." in said(found)
    assert ">not distinguishable</td>" in page_of(found)
    assert ">anticipative</td>" not in page_of(found).split("Each plan with the reaction")[0]
    assert re.search(r"(?m)^ +report .* undecided ", printed(found))


@pytest.mark.parametrize("half", [0.5, 50.0])
def test_a_claim_is_made_exactly_where_no_mark_of_doubt_stands(half: float) -> None:
    found = summary_of(reaction("report", PAYS, half=half, best="anticipative", over="stochastic"))
    assert ("is worth 1.0 %" in said(found)) == (f"1.0{DOUBTED} [" not in page_of(found))


def test_a_plan_that_re_planning_makes_worse_is_said_to_change_and_not_to_gain() -> None:
    # By the report the stochastic plan's robots do what they would have done better later: 100 becomes 98.
    found = summary_of(reaction("report", PAYS | {"stochastic": (100.0, 98.0)}, half=0.5, best="anticipative"))
    assert "Re-planning changes the deterministic plan by 25 % and the stochastic one by -2.0 % in S" in said(found)


def test_the_same_plan_is_called_so_and_not_a_matter_of_statistics() -> None:
    found = summary_of(reaction("report", {"stochastic": (100.0, 100.0), "deterministic": (100.0, 100.0)}, half=0.0,
                                over=None, same_plan=True))
    assert said(found) == ("If the team re-plans when a robot misses a report, both plans are the same in S. "
                           "Re-planning changes no plan's value.")
    assert "all alike" in printed(found)


def test_no_interval_no_claim() -> None:
    one = reaction("report", PAYS, best="anticipative")
    bare = replace(one, vss=replace(one.vss, executed=replace(one.vss.executed, ci95=None), distinguishable=False))
    assert "too few noise draws give an interval in S" in said(summary_of(bare))


def test_news_that_come_to_the_same_share_an_answer_and_others_have_their_own() -> None:
    twins = [reaction(news, PAYS, half=0.5, best="anticipative") for news in ("station", "report")]
    answers = reaction_answers(summary_of(*twins, reaction("instant", LOSES, half=0.5, best="deterministic")))
    assert [answer.condition for answer in answers] == [
        "If the team re-plans at the stations where robots hear of a failure, or when a robot misses a report,",
        "If the team re-plans the moment a robot fails,"]


def test_the_vss_without_reaction_is_by_the_missions_of_the_reaction_and_not_by_the_trials_of_the_run() -> None:
    # 100 - 90 = 10 of 100 by the missions; the run's own trials, in summary_of, say 20.
    found = summary_of(reaction("report", {"stochastic": (100.0, 101.0), "deterministic": (90.0, 100.0)}, half=0.5))
    for shown in (printed(found), page_of(found)):
        assert "10.0 [9.5, 10.5]" in shown
        assert "20.0" not in shown
    # The run's 20 % stands above: whose the other figure is must be said.
    assert "worth 1.0 % in S (in place of 10 % in the same missions)." in said(found)


def test_no_news_stands_apart_even_where_news_changes_nothing() -> None:
    still = {"stochastic": (100.0, 100.0), "deterministic": (80.0, 80.0)}
    answers = reaction_answers(summary_of(*(reaction(news, still, half=0.5) for news in ("report", "never"))))
    assert [answer.condition for answer in answers] == [
        "If the team re-plans when a robot misses a report,",
        "If the team re-plans on news of failures but never has any,"]
    assert "worth 20 % in S (as without reaction)" in str(answers[0])


def test_a_difference_is_told_in_one_percentage_and_not_in_that_of_another_base_too() -> None:
    # -9 is 8.9 % of 101 and 8.2 % of 110.
    found = summary_of(reaction("report", LOSES, half=0.5, best="deterministic", over="stochastic"))
    assert "the deterministic in S (+8.9 % over the stochastic)" in said(found)
    assert "8.2" not in said(found)


def test_plans_that_are_worth_exactly_the_same_are_the_best_together() -> None:
    level = {"stochastic": (90.0, 100.0), "deterministic": (80.0, 100.0)}
    assert "of those tried: both in S." in said(summary_of(reaction("report", level, half=0.0)))


@pytest.mark.parametrize("best", ["stochastic", "deterministic", "anticipative"])
def test_that_a_plan_made_for_the_reaction_is_one_of_the_two_is_said(best: str) -> None:
    over = "stochastic" if best != "stochastic" else "deterministic"
    plans = {**PAYS, "anticipative": (90.0, 101.0)}
    found = summary_of(reaction("report", plans, half=0.5, best=best, over=over))
    told = f"No plan made for it is better than the two: the anticipative plan is the {best} in S." in said(found)
    assert told == (best != "anticipative")
    assert "No plan made for it" not in said(summary_of(reaction("report", LOSES)))


@pytest.mark.parametrize("kept", [0.0, -50.0, 0.1])
def test_where_per_cent_tell_nothing_sentences_table_and_charts_are_in_incentive(kept: float) -> None:
    found = summary_of(reaction("report", {"stochastic": (kept, 30.0), "deterministic": (kept, 10.0)}, half=0.5))
    assert f"{30 - kept:.1f} of incentive to the stochastic one" in " ".join(said(found).split())
    assert "in incentive" in printed(found).strip().splitlines()[0]
    assert f"{30 - kept:.1f}" in printed(found)
    shown = page_of(found)
    assert f"VSS in {'incentive' if kept <= 0 else 'per cent'} without reaction" in shown  # its base is kept too
    assert "Value of recourse of each plan in incentive" in shown


def test_that_nothing_can_be_collected_is_said_plainly() -> None:
    found = summary_of(reaction("report", {"stochastic": (0.0, 0.0), "deterministic": (0.0, 0.0)}, half=0.0, over=None))
    assert said(found) == (
        "If the team re-plans when a robot misses a report, every plan is worth exactly nothing in S, whether the team "
        "reacts or not. Re-planning changes no plan's value.")


def test_the_headline_is_of_a_team_that_keeps_its_plan_where_another_reacts() -> None:
    assert answer(summary_of()).startswith("Planning for failures pays in S")
    assert answer(summary_of(reaction("report", LOSES))).startswith(
        "If the team keeps its plan, planning for failures pays")


def test_where_nobody_reacts_nothing_is_said_or_shown() -> None:
    found = summary_of()
    assert (said(found), reaction_assumptions(found), page_of(found), printed(found)) == ("", [], "", "")


@pytest.mark.parametrize("news", NEWS)
def test_terminal_and_page_say_who_knows_what_when(news: str) -> None:
    found = summary_of(reaction(news, PAYS, best="anticipative"))  # type: ignore[arg-type]
    for shown in (printed(found, 10_000), page_of(found)):
        assert f"{news} news: {KNOWS[news]}" in shown  # type: ignore[index]


def test_enumerated_histories_have_no_error_of_sampling_and_a_sample_has() -> None:
    every, some = (" ".join(reaction_assumptions(summary_of(reaction("report", PAYS, histories=mode))))
                   for mode in ("enumerated", "sampled"))
    assert "all histories of failures were played under each noise draw (8 missions a plan)" in every
    assert "the interval is that of the noise alone" in every
    assert "a sample of the histories" in some
    assert "noise alone" not in some


def test_a_plan_for_the_reaction_that_was_not_tried_is_offered() -> None:
    with_it, without = (" ".join(reaction_assumptions(summary_of(reaction("report", values, best="stochastic"))))
                        for values in (PAYS, LOSES))
    assert "--anticipate" in without
    assert "--anticipate" not in with_it


def test_the_terminals_table_fits_a_hundred_columns_and_cuts_nothing() -> None:
    reactions = [reaction(news, PAYS, best="anticipative", over="stochastic") for news in NEWS]
    shown = printed(summary_of(*reactions, names=("S1", "nominal")))
    assert max(map(len, shown.splitlines())) <= 100
    assert "…" not in shown
    assert re.search(r"(?m)^S1 +none +20\.0 \[19\.0, 21\.0\]$", shown)
    assert re.search(r"(?m)^ +report +1\.0° \[0\.0, 2\.0\] +1\.0° +25\.0  anticipative +3\.0 +50$", shown)


def test_doubled_visits_are_told_only_where_there_are_any() -> None:
    once, twice = (summary_of(reaction("station", PAYS, doubled=share)) for share in (0.0, 0.02))
    assert "doubled" not in page_of(once).lower()
    assert "two robots" not in printed(once)
    assert "doubled visits [per mission]" in page_of(twice)
    assert "0.02 a mission in S on station news (stochastic)" in " ".join(printed(twice).split())


def test_the_page_says_what_each_figure_is_and_shows_reaction_in_the_ledger() -> None:
    shown = page_of(summary_of(reaction("report", PAYS, best="anticipative", over="stochastic")))
    for name, meaning in DEFINITIONS:
        assert f"<b>{name}</b>: {untypeset(meaning)}" in shown
    ledger = shown[shown.index("With the reaction (policy resolve)"):]
    assert "<th scope=\"col\">reaction</th>" in ledger
    assert "<td>+20.0</td>" in ledger  # the deterministic plan: 80 becomes 100


def test_charts_show_as_many_scenarios_as_can_be_told_apart_and_say_so() -> None:
    names = tuple(f"S{k}" for k in range(MOST_PANELS + 1))
    few, many = (page_of(summary_of(reaction("report", PAYS), names=some)) for some in (names[:-1], names))
    assert f"The first {MOST_PANELS} of" not in few
    assert many.count(f"The first {MOST_PANELS} of {len(names)}.") == 2


def test_a_difference_in_per_cent_of_nothing_is_none() -> None:
    found = Estimate(mean=3.0, ci95=(1.0, 5.0))
    assert in_per_cent(found, 50.0) == Estimate(mean=6.0, ci95=(2.0, 10.0))
    assert [in_per_cent(found, of) for of in (0.0, -1.0, 1e-300)] == [None] * 3
    assert in_per_cent(Estimate(mean=3.0, ci95=None), 50.0) == Estimate(mean=6.0, ci95=None)


@pytest.mark.parametrize(("ends", "shown"), [
    ((1.0, 3.0), "2.0 [1.0, 3.0]"), ((-1.0, 5.0), f"2.0{DOUBTED} [-1.0, 5.0]"), (None, "2.0")])
def test_differences_whose_interval_holds_zero_are_marked(ends: tuple[float, float] | None, shown: str) -> None:
    assert doubted(Estimate(mean=2.0, ci95=ends)) == shown


@pytest.mark.parametrize(("chosen", "best", "same_plan", "share"), [
    ("survival^0.5", "anticipative", False, {"anticipative"}),
    ("survival^0.5", "anticipative", True, {"anticipative"}),
    ("deterministic", "deterministic", False, {"deterministic", "anticipative"}),
    ("stochastic", "stochastic", True, {"stochastic", "deterministic", "anticipative"}),
    ("stochastic", "deterministic", True, {"stochastic", "deterministic", "anticipative"}),
])
def test_plans_of_the_same_routes_share_being_the_best(
    chosen: str, best: str, same_plan: bool, share: set[str]
) -> None:
    # Of equals the first is chosen; what is alike by way of a third plan is alike.
    tried = tuple(Candidate(plan=name, theta=None, modelled=value) for name, value in (
        ("survival^0.25", 1.0), (chosen, 2.0), ("survival^0.75", 2.0)))
    one = reaction("report", PAYS, best=best, same_plan=same_plan)
    assert replace(one, candidates=tried).best_plans == share
    assert one.best_plans == ({best, "stochastic", "deterministic"} if same_plan and best != "anticipative" else {best})


def test_plans_whose_orders_change_in_other_shares_of_missions_are_told_as_a_range() -> None:
    one = reaction("report", LOSES)
    assert changed(one) == "50"
    never = replace(one.plans["stochastic"], reacted=0.0)
    assert changed(replace(one, plans={**one.plans, "stochastic": never})) == "0–50"


@pytest.mark.parametrize(("key", "value", "message"), [
    (("best", "plan"), "anticipative", "best.plan: expected one of 'plans'"),
    (("best", "over"), "anticipative", "best.over: expected one of 'plans'"),
    (("value_of_recourse",), {}, "value_of_recourse: expected that of each of 'plans'"),
    (("plans",), {}, "plans"),
])
def test_reactions_that_do_not_fit_together_are_refused(key: tuple[str, ...], value: Any, message: str) -> None:
    data = as_dict(reaction("report", LOSES))
    held = data
    for part in key[:-1]:
        held = held[part]
    held[key[-1]] = value
    with pytest.raises(ValueError, match=message):
        from_dict(ReactionResult, json.loads(json.dumps(data)))


@pytest.mark.parametrize("seed", range(4))
def test_terminal_and_page_hold_with_every_figure_that_a_reaction_may_have(seed: int) -> None:
    valid = as_dict(reaction("report", PAYS, best="anticipative", over="stochastic", doubled=0.1))
    rng, tried = random.Random(seed), 0
    while tried < 3:
        data = json.loads(json.dumps(valid))
        for at in rng.sample(list(numbers(data)), 8):
            held = data
            for key in at[:-1]:
                held = held[key]
            held[at[-1]] = rng.choice((0.0, 1e15, -1e15, 1e-300, None))
        try:
            found = summary_of(from_dict(ReactionResult, data))
        except ValueError:
            continue
        tried += 1
        assert "What reacting is worth" in page_of(found)
        assert "\n" in printed(found)


def numbers(data: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where numbers stand in JSON data."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if isinstance(value, float):
            yield (*at, key)
        yield from numbers(value, (*at, key))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("finished")
    options = Options(trials=40, rollouts=4, fidelity="kinematic", policies=("resolve",), news=("report", "instant"),
                      anticipate=True)
    return run(world_of(folder), options, folder / "runs", None, lambda *_: None)


def summary_in(finished: Run) -> Summary:
    assert isinstance(finished.summary, Summary)
    return finished.summary


def test_page_and_terminal_of_a_run_answer_alike(finished: Run) -> None:
    found = summary_in(finished)
    text = read(finished.folder / "report.html")
    shown = printed(found, 10_000)
    answers = reaction_answers(found)
    assert answers
    for said in answers:
        assert str(said) in shown
        assert all(sentence in text for sentence in (said.condition, *said.sentences))
    assert text.index("What if the robots re-plan?") < text.index("Value of the stochastic solution (VSS)")


def test_the_page_lists_what_the_anticipative_plan_was_chosen_from(finished: Run) -> None:
    text = html.unescape((finished.folder / "report.html").read_text())
    listed = text[text.index("Plans that the anticipative one was chosen from"):].split("</table>")[0]
    for scenario, found in reacting(summary_in(finished)):
        assert f"V, {found.name}" in listed
        for tried in found.candidates:
            row = rf">{scenario.name}</td><td[^>]*>{re.escape(tried.plan)}</td>.*>{tried.modelled:.1f}<"
            assert re.search(row, listed)


def test_a_run_without_failures_reacts_to_nothing(finished: Run) -> None:
    safe = next(row for row in reacting(summary_in(finished)) if row.scenario.name == "safe")
    assert {plan.reacted for plan in safe.reaction.plans.values()} == {0.0}
    assert {gain.mean for gain in safe.reaction.value_of_recourse.values()} == {0.0}


def test_a_summary_shows_its_reactions_in_a_line_each_and_as_rows(finished: Run) -> None:
    found = summary_in(finished)
    assert repr(found).count("resolve on report news: VSS") == len(found.scenarios)
    assert "anticipative, resolve on instant news" in found._repr_html_()


def test_csv_has_a_row_for_each_scenario_policy_news_and_plan(finished: Run) -> None:
    written = {path.name: path for path in write_csv(finished.folder)}
    with written["reactions.csv"].open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(REACTION_COLUMNS)
    expected = [(row.scenario.name, row.reaction.policy, row.reaction.news, name)
                for row in reacting(summary_in(finished)) for name in row.reaction.plans]
    assert [(row["scenario"], row["policy"], row["news"], row["planner"]) for row in rows] == expected
    for row in rows:  # the ledger adds up in the file too
        parts = [float(value) for key, value in row.items() if key.startswith("ledger.")]
        assert float(row["promised"]) + sum(parts) == pytest.approx(float(row["executed"]), abs=1e-9)


def test_no_csv_of_reactions_where_there_are_none(tmp_path: Path) -> None:
    plain = run(world_of(tmp_path), Options(trials=8, rollouts=2, fidelity="kinematic"), tmp_path / "runs", None,
                lambda *_: None)
    assert "reactions.csv" not in {path.name for path in write_csv(plain.folder)}
