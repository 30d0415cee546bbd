"""The command that plays one trial of a run again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from sva_bench.choices import NEWS, POLICY_NAMES, RECORDED_WORDS
from sva_bench.cli.loading import loading
from sva_bench.cli.options import TRIAL_METAVAR, AsJson, Verbose, WorkerCount
from sva_bench.cli.terminal import messages, print_hanging, print_json, progress_bars, set_up_logging
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_folder
from sva_bench.study.libraries import PRELOAD, load_libraries
from sva_bench.study.reacting import news_of, policies_of
from sva_bench.workers.pool import local_workers


def replay(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)],
    trial: Annotated[str, typer.Option(metavar=TRIAL_METAVAR, help="Number of the trial, or of the history, as in "
                                       "outcomes.parquet; or "
                                       + ", ".join(f"{name} ({said})" for name, said in RECORDED_WORDS.items())
                                       + ", each plan's own.", show_default=False)],
    scenario: Annotated[str | None, typer.Option(help="The scenario.", show_default="the only one")] = None,
    planner: Annotated[str | None, typer.Option(help="Whose plan.", show_default="each")] = None,
    policy: Annotated[str, typer.Option(
        help=f"What the team does about failures: {', '.join(POLICY_NAMES)}.")] = "none",
    news: Annotated[str | None, typer.Option(help=f"When it learns of a failure: {', '.join(NEWS)}.",
                                             show_default="the only one of the run")] = None,
    view: Annotated[bool, typer.Option("--view", help="Open the recordings in the Rerun viewer.")] = False,
    workers: WorkerCount = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Play one trial of a finished run again, and record it.

    The recordings go to the run's folder. Of teams that react it is said what was heard when, and how orders changed.
    --json prints the trial's rows as they stand in outcomes.parquet, and these reactions.
    """
    set_up_logging(verbose)
    policies, heard = policies_of([policy]), news_of([] if news is None else [news])
    if len(policies) > 1 or len(heard) > 1:
        raise BadInput("--policy, --news: one of each is replayed at a time; name one")
    if folder.is_dir():  # else it is said what it is
        check_folder(folder / "recordings", "RUN")
    load_libraries()
    with loading():
        from sva_bench.recording.viewer import view as open_viewer
        from sva_bench.storage.trial_choice import choice_of
        from sva_bench.study.replay import Wanted
        from sva_bench.study.replay import replay as play_again

    choice = choice_of(trial)
    wanted = Wanted(scenario=scenario, trial=choice.trial, kind=choice.kind, planner=planner, policy=policies[0],
                    news=heard[0] if heard else None)
    with progress_bars() as progress, local_workers(workers, PRELOAD) as executor:
        found = play_again(folder, wanted, executor, progress)
    if as_json:
        print_json({"format": "sva-bench/replay@1", "rows": [row for one in found for row in one.rows],
                    "reactions": [heard for one in found for heard in one.reactions_as_dicts()]})
    else:
        for one in found:
            for row in one.rows:
                which = f"trial {row['trial']}, " if choice.kind != "trial" else ""
                print_hanging(f"{row['scenario']}, {row['planner']}, {which}{row['robot']}: {row['end']} at "
                              f"{row['end_time_s']:.1f} s, value {row['value']:g}")
            for line in one.told():
                print_hanging(line.strip(), " " * (2 + len(line) - len(line.lstrip())))
    for one in found:
        assert one.recording is not None
        messages.print(f"recorded in [bold]{escape(str(one.recording))}[/bold]", highlight=False, soft_wrap=True)
        if view:
            open_viewer((one.recording,), web=False, screenshot=None, at_s=None)
