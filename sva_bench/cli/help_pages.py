"""The pages of ``--help``: options in groups, short names of their values, and an example of each command."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

_GROUPS: Mapping[str, tuple[str, ...]] = {
    "What is measured": (
        "seed", "trials", "rollouts", "fidelity", "scenario", "trial", "expressions", "precision", "anytime",
        "max_trials", "informed", "assumptions", "evpi", "vary", "compare", "noise", "draws", "sample"),
    "Plans": ("planner", "margin", "plan_failure", "calibrate", "time_limit", "gap", "objective", "method", "cuts",
              "risk", "beta", "weight", "target", "allow_infeasible", "plan", "tau", "whole"),
    "Failures, news and other robots": ("execute_failure", "policy", "news", "anticipate", "interaction", "departures"),
    "Running": ("resume", "dry_run", "workers", "dask", "unit_trials", "unit_time_limit", "memory_mb", "cache"),
    "Output": ("out", "output", "to", "csv", "as_csv", "as_json", "junit", "wide", "verbose", "force", "view",
               "screenshot", "at", "video", "web", "listed"),
}
"""Options of commands by group; all others stand first, under Options."""

EXAMPLES: Mapping[str, tuple[str, ...]] = {
    "run": ("sva-bench run worlds/four-rooms.yaml",
            "sva-bench run worlds/maze.yaml --scenario S3 --policy none,resolve --news report"),
    "times": ("sva-bench times worlds/four-rooms.yaml --scenario S3 -o four-rooms.json",),
    "plan": ("sva-bench plan worlds/four-rooms.yaml --scenario S3 -o plan.json",),
    "certify": ("sva-bench certify four-rooms.json plan.json",),
    "execute": ("sva-bench execute worlds/four-rooms.yaml plan.json mine.csv --scenario S3",),
    "expect": ('sva-bench expect runs/four-rooms-seed0-1a2b3c4d "S3.vss.executed_pct >= 5"',),
    "export": ("sva-bench export plan.json --world worlds/four-rooms.yaml --to nav2 -o way.yaml",),
    "view": ("sva-bench view runs/four-rooms-seed0-1a2b3c4d --scenario S3",
             "sva-bench view runs/four-rooms-seed0-1a2b3c4d --scenario S3 --trial worst --video worst.gif"),
    "report": ("sva-bench report runs/four-rooms-seed0-1a2b3c4d --csv",
               "sva-bench report runs/sweep --compare robots.uv2.fuel_capacity_s=50"),
    "replay": ("sva-bench replay runs/four-rooms-seed0-1a2b3c4d --scenario S3 --trial 17",),
    "verify": ("sva-bench verify runs/four-rooms-seed0-1a2b3c4d",),
    "doctor": ("sva-bench doctor",),
    "batch": ('sva-bench batch "worlds/*.yaml" --seed 0-9 --out runs/shipped',
              "sva-bench batch worlds/*.yaml --set robots.uv2.fuel_capacity_s=x0.8,x1,x1.2",
              "sva-bench batch status runs/shipped"),
    "batch retry": ("sva-bench batch retry runs/shipped --workers 2",),
    "batch status": ("sva-bench batch status runs/shipped",),
    "world": ("sva-bench world example four-rooms -o mine.yaml",),
    "world check": ("sva-bench world check mine.yaml", "sva-bench world check mine.yaml --noise --scenario S3"),
    "world random": ("sva-bench world random --family maze --pois 12 -o maze.yaml",),
    "world from-map": ("sva-bench world from-map map.yaml --pois 20 --robots 3 -o mine.yaml",),
    "world example": ("sva-bench world example four-rooms -o mine.yaml",),
    "world draw": ("sva-bench world draw mine.yaml --plan plan.json -o mine.svg",),
    "world schema": ("sva-bench world schema",),
    "instance": ("sva-bench instance random --pois 20 -o instance.json",),
    "instance random": ("sva-bench instance random --family B --pois 20 -o instance.json",),
    "reproduce": ("sva-bench reproduce rewards -o rewards.md",),
    "reproduce rewards": ("sva-bench reproduce rewards -o rewards.md",),
    "reproduce simulation": ("sva-bench reproduce simulation --trials 200 -o simulation.md",),
    "reproduce reaction": ("sva-bench reproduce reaction worlds/maze.yaml -o reaction.md",),
    "reproduce runtimes": ("sva-bench reproduce runtimes --time-limit 10",),
    "": ("sva-bench run worlds/four-rooms.yaml", "sva-bench run --help", "sva-bench doctor"),
}
"""What may be typed, by command; the first two lines of the whole program are its own."""

_OF = {name: group for group, names in _GROUPS.items() for name in names}
_LONGEST = 14
"""Letters of the words to choose from that stand beside an option; longer ones are said in its help."""


def arranged(command: Any, words: str) -> None:
    """Put the page of a command into shape, once.

    Args:
        command: The command, or a group of them.
        words: What calls it, behind the name of the program.
    """
    if getattr(command, "is_arranged", False):
        return
    command.is_arranged = True
    for parameter in command.params:
        if parameter.param_type_name != "option":
            continue
        parameter.rich_help_panel = parameter.rich_help_panel or _OF.get(parameter.name)
        if parameter.is_flag:
            parameter.metavar = ""
        elif parameter.metavar is None:
            _name_value(parameter)
    examples = "\n".join(f"  {line}" for line in EXAMPLES.get(words, ()))
    command.epilog = "\n\n".join(part for part in (command.epilog, f"Example:\n{examples}" if examples else "") if part)


def _name_value(parameter: Any) -> None:
    """Name an option's value in a word: a column of choices or bounds would leave no room for what is said of it."""
    annotation = parameter.type_descriptor.annotation
    choices = get_args(annotation) if get_origin(annotation) is Literal else ()
    if not choices:
        parameter.metavar = {int: "N", float: "X", Path: "PATH"}.get(annotation, "NAME")
        return
    spelt = "|".join(map(str, choices))
    parameter.metavar = spelt if len(spelt) <= _LONGEST else "NAME"
    if len(spelt) > _LONGEST and not all(str(choice) in str(parameter.help) for choice in choices):
        parameter.help = f"{parameter.help} One of {', '.join(map(str, choices))}."
