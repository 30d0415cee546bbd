"""Errors that a user can mend, and the exit codes of the commands."""

from __future__ import annotations

from difflib import get_close_matches
from enum import IntEnum
from pathlib import Path
from typing import ClassVar


class ExitCode(IntEnum):
    """What a command's exit status means (``docs/ci.md``)."""

    DONE = 0
    FAULT = 1
    BAD_INPUT = 2
    INFEASIBLE_PLAN = 3
    UNFINISHED_TRIALS = 4
    EXPECTATION_NOT_MET = 5
    INTERRUPTED = 130


class SvaBenchError(Exception):
    """Something that a user can mend: what happened, where, what to change."""

    exit_code: ClassVar[ExitCode] = ExitCode.BAD_INPUT


class BadInput(SvaBenchError):
    """An argument or a combination of options that makes no sense."""

    def __init__(self, message: str) -> None:
        super().__init__(message)


class UnknownName(BadInput, KeyError):
    """A name that is not there, with the nearest that is; a ``KeyError`` too, as of any mapping."""

    def __init__(self, message: str) -> None:
        super().__init__(message)

    def __str__(self) -> str:
        return str(self.args[0])  # a KeyError shows the repr of its key


class Interrupted(SvaBenchError):
    """Ctrl-C, once a command has kept what it had: says what that is."""

    exit_code = ExitCode.INTERRUPTED


class BadFile(SvaBenchError):
    """A file whose content is wrong, with the place in it."""

    def __init__(self, path: Path | str, line: int | None, key: str, problem: str) -> None:
        super().__init__(str(path), line, key, problem)  # facts, not text: survives pickling
        self.path, self.line, self.key, self.problem = str(path), line, key, problem

    def __str__(self) -> str:
        where = self.path if self.line is None else f"{self.path}:{self.line}"
        return f"{where}: {self.key}: {self.problem}" if self.key else f"{where}: {self.problem}"


def closest(word: str, candidates: list[str]) -> str | None:
    """The valid word closest to ``word``; ``None`` when none is close."""
    close = get_close_matches(word[:200], candidates, n=1, cutoff=0.5)
    return close[0] if close else None


def nearest(word: str, candidates: list[str]) -> str:
    """A hint that names the valid word closest to ``word``, or all of them when none is close."""
    close = closest(word, candidates)
    if close is not None:
        return f"did you mean {close!r}?"
    known = sorted(candidates)
    if len(known) > 12:
        return f"known: {', '.join(known[:10])} and {len(known) - 10} more"
    return f"known: {', '.join(known)}" if known else "none is defined"
