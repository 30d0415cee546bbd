"""``docs/commands.md``, made of the commands' help: ``python -m tests.reference_commands > docs/commands.md``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import typer
from rich.text import Text

from sva_bench.cli.app import app

HEAD = """\
# Commands

What `sva-bench COMMAND --help` says, on one page. Results go to standard output, progress and messages to standard
error; `--json` prints a result as JSON, and nothing else. Exit codes are those of
[Check results in CI](ci.md#exit-codes).

"""
TAIL = """\

This page is made of the commands' help (`python -m tests.reference_commands`).
"""
UNSAID = {"over"}
"""Commands of a group that are called by the group's name alone."""
GROUPS = ("Arguments", "Options")


def page() -> str:
    """The page."""
    found = list(_commands(typer.main.get_command(app), "sva-bench"))
    rows = [f"| [`{name}`](#{_anchor(name)}) | {_plain(command.help).splitlines()[0]} |" for name, command in found]
    sections = [_section(name, command) for name, command in found]
    return "\n".join([HEAD + "| command | does |", "| --- | --- |", *rows, "", "\n".join(sections)]) + TAIL


def _commands(group: Any, path: str) -> Iterator[tuple[str, Any]]:
    """What is typed, and the command behind it, those of groups in their place."""
    for name, command in group.commands.items():
        told = path if name in UNSAID else f"{path} {name}"
        if getattr(command, "commands", None):
            yield from _commands(command, told)
        elif not command.hidden:
            yield told, command


def _anchor(name: str) -> str:
    return name.replace(" ", "-")


def _section(name: str, command: Any) -> str:
    arguments = [given for given in command.params if given.param_type_name == "argument"]
    usage = " ".join([name, "[OPTIONS]", *(given.metavar or given.name.upper() for given in arguments)])
    lines = [f"## {name}", "", _plain(command.help), "", "```text", usage, "```", ""]
    groups: dict[str, list[Any]] = {}
    for given in command.params:
        if not given.hidden:
            kind = GROUPS[_is_option(given)]
            groups.setdefault(given.rich_help_panel or kind, []).append(given)
    for title, members in groups.items():
        what = "argument" if title == "Arguments" else "option"
        if title not in GROUPS:
            lines += [f"**{_plain(title)}**", ""]
        lines += [f"| {what} | meaning | default |", "| --- | --- | --- |"]
        lines += [_row(given) for given in members] + [""]
    if command.epilog:
        lines += [_plain(command.epilog), ""]
    return "\n".join(lines)


def _row(given: Any) -> str:
    named = given.opts if _is_option(given) else [given.metavar or given.name.upper()]
    names = ", ".join(f"`{name}`" for name in [*named, *given.secondary_opts])
    unsaid = "repeated" not in (given.help or "") and "," not in (given.metavar or "")
    repeated = ["may be repeated"] if _is_option(given) and given.multiple and unsaid else []
    values = ", ".join([*_values(given), *repeated])
    cells = [names, " ".join([_plain(given.help), *([f"*{values[0].upper()}{values[1:]}.*"] if values else [])]),
             _default(given)]
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def _is_option(given: Any) -> bool:
    return bool(given.param_type_name == "option")


def _values(given: Any) -> list[str]:
    """What may be given: words, bounds, or what its place in the usage line is called."""
    annotation = given.type_descriptor.annotation
    words = [f"`{word}`" for part in (annotation, *get_args(annotation)) if get_origin(part) is Literal
             for word in get_args(part)]
    if words:
        return words
    if (given.min, given.max) != (None, None):
        low, high = (None if bound is None else f"{bound:,}".replace(",", " ") for bound in (given.min, given.max))
        endless = high is None or given.max > 10 ** 12
        return [f"{low} or more" if endless else f"up to {high}" if low is None else f"{low} to {high}"]
    return [f"`{word}`" for word in given.metavar.split("|")] if given.metavar and _is_option(given) else []


def _default(given: Any) -> str:
    if isinstance(given.show_default, str):
        return given.show_default
    if given.required:
        return "required"
    shown = given.show_default and given.default not in (None, (), []) and given.default is not False
    value = given.default.as_posix() if isinstance(given.default, Path) else given.default
    return f"`{value}`" if shown else ""


def _plain(text: str | None) -> str:
    """Help without its markup, paragraphs unwrapped."""
    plain = Text.from_markup(text or "").plain.replace("\b", "").replace("*", "\\*")
    return "\n\n".join(" ".join(part.split()) for part in plain.split("\n\n")).strip()


if __name__ == "__main__":
    import sys

    sys.stdout.write(page())
