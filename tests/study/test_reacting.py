"""Reactions as they are asked for: which words are taken, which pairs are measured, and what doesn't go together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sva_bench.choices import NEWS, POLICY_NAMES, USUAL_NEWS, News, PolicyName
from sva_bench.errors import BadInput
from sva_bench.study.options import Options, identity_of, reactions_of
from sva_bench.study.reacting import check_reactions, news_of, pairs_of, policies_of
from sva_bench.world.load import load_world
from sva_bench.world.model import World, WorldReaction

WORLD = load_world(Path(__file__).parents[2] / "worlds" / "open-field.yaml")
REACTING: tuple[PolicyName, ...] = tuple(name for name in POLICY_NAMES if name != "none")
REACTIONS = [WorldReaction(), *(WorldReaction(policy=policy, news=news) for policy, news in product(REACTING, NEWS))]
Parse = Callable[[Sequence[str]], tuple[str, ...]]
LISTS: list[tuple[Parse, str, tuple[str, ...]]] = [(policies_of, "--policy", POLICY_NAMES), (news_of, "--news", NEWS)]

some_policies = st.lists(st.sampled_from(POLICY_NAMES), max_size=4)
some_news = st.lists(st.sampled_from(NEWS), max_size=5)


def reacting(reaction: WorldReaction, *, stations: bool = True) -> World:
    sites = tuple(site for site in WORLD.sites if stations or site.kind != "station")
    return replace(WORLD, reaction=reaction, sites=sites)


@pytest.mark.parametrize(("parse", "option", "known"), LISTS)
def test_words_are_taken_in_the_order_given_with_commas_or_one_by_one(
    parse: Parse, option: str, known: tuple[str, ...]
) -> None:
    backwards = known[::-1]
    assert parse([",".join(backwards)]) == parse(list(backwards)) == parse([" , ".join(backwards)]) == backwards
    assert parse([]) == (), option


@pytest.mark.parametrize(("parse", "option", "known"), LISTS)
@pytest.mark.parametrize("mistake", [
    lambda known: [f"{known[0]},"], lambda known: [f",{known[0]}"], lambda known: [f"{known[0]},,{known[1]}"],
    lambda _: [" "], lambda known: [f"{known[0]},{known[0]}"], lambda known: [known[0], known[1], known[0]],
    lambda known: [f"{known[0]}x"], lambda known: [known[0].upper()], lambda known: [f"{known[0]} {known[1]}"]])
def test_a_word_that_is_missing_unknown_or_a_duplicate_is_refused_by_its_option(
    parse: Parse, option: str, known: tuple[str, ...], mistake: Callable[[tuple[str, ...]], list[str]]
) -> None:
    with pytest.raises(BadInput, match=rf"^{option} .+") as refused:
        parse(mistake(known))
    assert str(refused.value).count(option) == 1


@pytest.mark.parametrize(("parse", "option", "known"), LISTS)
def test_an_unknown_word_is_answered_with_the_nearest(parse: Parse, option: str, known: tuple[str, ...]) -> None:
    for word in known:
        with pytest.raises(BadInput, match=f"{option} '{word}x': .*did you mean '{word}'"):
            parse([f"{word}x"])


# Which pairs are measured


def test_the_pairs_of_a_world_are_those_worked_out_by_hand() -> None:
    silent, own = reacting(WorldReaction()), reacting(WorldReaction(policy="resolve", news="instant"))
    assert pairs_of(silent, (), ()) == ()
    assert pairs_of(own, (), ()) == (("resolve", "instant"),)
    assert pairs_of(own, ("none",), ()) == ()
    assert pairs_of(silent, ("none", "resolve"), ()) == (("resolve", "report"),)
    assert pairs_of(own, ("resolve",), ()) == (("resolve", "instant"),)
    assert pairs_of(own, (), ("report", "never")) == (("resolve", "report"), ("resolve", "never"))


@given(st.sampled_from(REACTIONS), some_policies, some_news)
def test_every_policy_that_reacts_meets_all_news_once_in_the_order_given(
    own: WorldReaction, policies: list[PolicyName], news: list[News]
) -> None:
    world = reacting(own)
    pairs = reactions_of(world, Options(policies=tuple(policies), news=tuple(news)))
    assert len(set(pairs)) == len(pairs)
    asked: list[PolicyName] = [name for name in policies or [own.policy] if name != "none"]
    heard = news or [own.news if own.policy != "none" else USUAL_NEWS]
    assert set(pairs) == set(product(asked, heard))
    places = [(asked.index(policy), heard.index(when)) for policy, when in pairs]
    assert places == sorted(places)


@pytest.mark.parametrize("own", REACTIONS)
def test_what_the_world_says_is_the_default_and_asking_for_it_changes_nothing(own: WorldReaction) -> None:
    world = reacting(own)
    expected = () if own.policy == "none" else ((own.policy, own.news),)
    assert pairs_of(world, (), ()) == pairs_of(world, (own.policy,), ()) == expected


@given(st.sampled_from(REACTIONS), some_policies, some_news, some_policies, some_news)
def test_runs_are_named_alike_exactly_if_the_same_reactions_are_measured(
    own: WorldReaction, policies: list[PolicyName], news: list[News], others: list[PolicyName], other_news: list[News]
) -> None:
    one, two = (Options(policies=tuple(asked), news=tuple(heard)) for asked, heard in (
        (policies, news), (others, other_news)))
    world = reacting(own)
    alike = identity_of(world, one) == identity_of(world, two)
    assert alike == (reactions_of(world, one) == reactions_of(world, two))
    assert identity_of(world, one) != identity_of(world, replace(one, anticipate=True))


@pytest.mark.parametrize("own", REACTIONS)
def test_a_run_that_asks_for_no_reaction_is_named_as_ever(own: WorldReaction) -> None:
    assert identity_of(reacting(own), Options()) == Options().as_dict()


# What doesn't go together


@given(st.sampled_from(REACTIONS), some_policies, some_news, st.booleans(), st.booleans())
def test_what_passes_has_somebody_to_hear_it_somewhere_and_something_to_anticipate(
    own: WorldReaction, policies: list[PolicyName], news: list[News], stations: bool, anticipate: bool
) -> None:
    world = reacting(own, stations=stations)
    pairs = pairs_of(world, policies, news)
    unheard = not pairs and set(news) - {"never"}
    nowhere = not stations and "station" in {when for _, when in pairs}
    nothing = anticipate and not {when for _, when in pairs} - {"never"}
    if unheard or nowhere or nothing:
        with pytest.raises(BadInput, match=r"^--(news|anticipate): ") as refused:
            check_reactions(world, policies, news, anticipate=anticipate)
        assert str(refused.value).startswith("--news" if unheard or nowhere else "--anticipate")
    else:
        check_reactions(world, policies, news, anticipate=anticipate)
