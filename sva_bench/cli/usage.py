"""Usage lines as a user types them."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from sva_bench.cli.help_pages import arranged
from sva_bench.errors import BadInput


def words_of(context: Any) -> str:
    """What calls a command, behind the name of the program; a group's unnamed command is called by the group's."""
    named = isinstance(context, _NameOfTheGroup)
    if context.parent is None:
        return ""
    return words_of(context.parent) if named else f"{words_of(context.parent)} {context.info_name}".strip()


class PlainCommand(TyperCommand):
    """A command whose arguments stand in its usage line by their names alone: ``execute [OPTIONS] WORLD PLAN...``.

    Empty values are refused: of a path, ``''`` would be the current folder, and mostly is a variable that isn't set.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse what is empty, before it is taken for something."""
        given, _, parameters = self.make_parser(ctx).parse_args(args=list(args))
        for parameter in parameters:
            value = given.get(parameter.name)
            if "" in (value if isinstance(value, tuple | list) else (value,)):
                option = parameter.param_type_name == "option"
                name = max(parameter.opts, key=len) if option else parameter.metavar
                raise BadInput(f"{name}: its value is empty, as of a variable that isn't set; give one"
                               + (", or leave the option out" if option and not parameter.required else ""))
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The command's page, in groups and with an example."""
        arranged(self, words_of(ctx))
        super().format_help(ctx, formatter)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """The words of the usage line after the command's name."""
        pieces = [self.options_metavar] if self.options_metavar else []
        arguments = [given for given in self.get_params(ctx) if given.param_type_name == "argument"]
        return [*pieces, *(given.metavar or str(given.name) for given in arguments)]


class OneAtATime(PlainCommand):
    """A command that takes one thing; several, as a shell's pattern gives, are answered with what to do."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Say how it is called, where more than one is named."""
        _, beyond, parameters = self.make_parser(ctx).parse_args(args=list(args))
        taken = [parameter for parameter in parameters if parameter.param_type_name == "argument"]
        if beyond and not any(word.startswith("-") for word in beyond):
            what = str(taken[0].metavar)
            raise BadInput(f"sva-bench {ctx.info_name} takes one {what}, and {len(beyond) + 1} are named; call it once "
                           "for each")
        return super().parse_args(ctx, args)


class _NameOfTheGroup(typer.Context):
    """The group's words are the command's: nobody types its own."""

    @property
    def command_path(self) -> str:
        """What is typed before the arguments."""
        return self.parent.command_path if self.parent is not None else super().command_path


class UnnamedCommand(PlainCommand):
    """The command that a group stands for where none is named."""

    context_class = _NameOfTheGroup


class PlainGroup(TyperGroup):
    """A group of commands whose page has an example."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The group's page."""
        arranged(self, words_of(ctx))
        super().format_help(ctx, formatter)


class WorldsFirst(PlainGroup):
    """``batch WORLD...`` is ``batch over WORLD...``: what is no command is a world."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the command's name where it is left out."""
        known = args and args[0] in self.commands
        return super().parse_args(ctx, args if known else ["over", *args])
