"""Reactions as they are asked for: policies and news by name, and the pairs of them that are measured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sva_bench.choices import NEWS, POLICY_NAMES, USUAL_NEWS, News, PolicyName
from sva_bench.errors import BadInput
from sva_bench.files.words import words_of

if TYPE_CHECKING:
    from sva_bench.world.model import World  # commands check their words before they load it

Reaction = tuple[PolicyName, News]


def policies_of(words: Sequence[str], what: str = "--policy ") -> tuple[PolicyName, ...]:
    """Policies of an option such as ``none,resolve``, in the order given.

    Args:
        words: Its values, each a name or several with commas between them.
        what: What complaints begin with.

    Raises:
        BadInput: If a name is unknown, missing or a duplicate.
    """
    return words_of(words, what, POLICY_NAMES, "policy")


def news_of(words: Sequence[str], what: str = "--news ") -> tuple[News, ...]:
    """News of an option such as ``report,instant``, in the order given; as ``policies_of``.

    Raises:
        BadInput: If a word is unknown, missing or a duplicate.
    """
    return words_of(words, what, NEWS, "kind of news")


def pairs_of(world: World, policies: Sequence[PolicyName], news: Sequence[News]) -> tuple[Reaction, ...]:
    """The reactions to be measured beside none: every policy that reacts with all news, duplicates removed.

    Args:
        world: The world.
        policies: The policies asked for; empty = the world's.
        news: The news asked for; empty = the world's, or the usual one if the world has no reaction.
    """
    own = world.reaction
    heard = news or (USUAL_NEWS if own.policy == "none" else own.news,)
    return tuple(dict.fromkeys((policy, when) for policy in policies or (own.policy,) if policy != "none"
                               for when in heard))


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """An option that doesn't go with the world or with the others, and the problem with it."""

    option: str
    problem: str


def misfit(
    world: World, policies: Sequence[PolicyName], news: Sequence[News], *, anticipate: bool
) -> Misfit | None:
    """What doesn't fit among these options and the world; ``None`` = they all do.

    Args:
        world: The world.
        policies, news: As for ``pairs_of``.
        anticipate: Whether a plan is made for the reaction.
    """
    pairs = pairs_of(world, policies, news)
    if not pairs and any(when != "never" for when in news):
        return Misfit(option="news", problem="no policy reacts to it; add the policy resolve, or leave the news out")
    if any(when == "station" for _, when in pairs) and not world.stations:
        return Misfit(option="news", problem=f"{world.name} has no station to hear it at; place one under "
                                             "sites.stations, or choose report or instant")
    if anticipate and all(when == "never" for _, when in pairs):
        missing = "news other than never" if pairs else "the policy resolve, or a reaction to the world file"
        return Misfit(option="anticipate", problem=f"plans for a reaction to failures, and {world.name} has none; add "
                                                   f"{missing}")
    return None


def check_reactions(
    world: World, policies: Sequence[PolicyName], news: Sequence[News], *, anticipate: bool = False
) -> None:
    """Refuse reactions that don't fit; arguments as for ``misfit``.

    Raises:
        BadInput: If one doesn't.
    """
    if found := misfit(world, policies, news, anticipate=anticipate):
        raise BadInput(f"--{found.option}: {found.problem}")


def refuse_the_name(plans: Iterable[str], *, anticipate: bool) -> None:
    """Refuse a given plan that goes by the name of the one that is made for a reaction.

    Raises:
        BadInput: If one does.
    """
    if anticipate and "anticipative" in plans:
        raise BadInput("--anticipate: the plan made for the reaction goes by the name 'anticipative', as one of the "
                       "given plans does; give that another name")
