"""Options and keys that take several names, given again or with commas between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from sva_bench.errors import BadInput, nearest
from sva_bench.files.printable import shown

Word = TypeVar("Word", bound=str)


def words_of(words: Sequence[str], what: str, known: Sequence[Word], kind: str) -> tuple[Word, ...]:
    """The known names that an option gives, in its order.

    Args:
        words: Its values, each a name or several with commas between them.
        what: What complaints begin with.
        known: The names that there are.
        kind: What they are names of.

    Raises:
        BadInput: If a name is unknown, missing or a duplicate.
    """
    by_name = {str(word): word for word in known}
    found: list[Word] = []
    for part in ",".join(words).split(",") if words else ():
        name = part.strip()
        if not name:
            raise BadInput(f"{what}{shown(','.join(words))}: an entry is empty; expected names with commas between "
                           f"them, of {', '.join(known)}")
        if name not in by_name:
            raise BadInput(f"{what}{shown(name)}: there is no such {kind}; {nearest(name, list(by_name))}")
        if by_name[name] in found:
            raise BadInput(f"{what}{name}: given twice; give it once")
        found.append(by_name[name])
    return tuple(found)
