"""Commands that show what is there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from sva_bench.cli.loading import loading
from sva_bench.cli.options import TRIAL_METAVAR, AsCsv, CompareKeys, Verbose, Wide
from sva_bench.cli.terminal import messages, progress_bars, results, say_written, set_up_logging
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_folder, check_output, write_result
from sva_bench.study.libraries import PRELOAD, load_libraries
from sva_bench.workers.pool import local_workers

if TYPE_CHECKING:
    from sva_bench.storage.trial_choice import TrialChoice

_WHICH = "Which recording"


def view(
    recording: Annotated[Path, typer.Argument(metavar="RUN-or-RRD", help="Run folder, or one recording.",
                                              show_default=False)],
    web: Annotated[bool, typer.Option("--web", help="Serve it to a browser, on this machine only.")] = False,
    screenshot: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Take a picture without a screen.",
                                                    show_default=False)] = None,
    video: Annotated[Path | None, typer.Option(metavar="OUT.gif|mp4", help="Draw a video of the whole mission: GIF, or "
                                               "MP4 with the extra 'video'.", show_default=False)] = None,
    at: Annotated[float | None, typer.Option(metavar="S", min=0, help="Mission time of the picture.",
                                             show_default="the end")] = None,
    scenario: Annotated[str | None, typer.Option(help="Of a run: only recordings of this scenario.",
                                                 rich_help_panel=_WHICH, show_default="all")] = None,
    planner: Annotated[str | None, typer.Option(help="Of a run: only recordings of this planner's plan.",
                                                rich_help_panel=_WHICH, show_default="all")] = None,
    trial: Annotated[str | None, typer.Option(metavar=TRIAL_METAVAR, help="Of a run: only this trial, which is played "
                                              "again if it isn't recorded.", rich_help_panel=_WHICH,
                                              show_default="all")] = None,
) -> None:
    """Open recordings in the Rerun viewer, or draw one.

    Of a run the most telling is seen first, and drawn: two plans side by side where they differ most.
    """
    if video is not None and (web or screenshot is not None or at is not None):
        raise BadInput("--video draws the whole mission: leave out --web, --screenshot and --at")
    with loading():
        from sva_bench.recording.viewer import recordings_of
        from sva_bench.recording.viewer import view as open_viewer
        from sva_bench.storage.recordings import most_telling, recordings_for
        from sva_bench.storage.stored_run import missing, run_folder_at
        from sva_bench.storage.trial_choice import choice_of

    if recording.is_dir() and next((recording / "recordings").glob("*.rrd"), None) is None:
        raise missing(run_folder_at(recording), recording / "recordings" / "*.rrd")  # or what it is, if it is none
    for output, option in ((screenshot, "--screenshot"), (video, "--video")):
        if output is not None:
            check_output(output, recording, way_out=f"choose another place with {option}")
    choice = None if trial is None else choice_of(trial)
    if scenario is None and planner is None and choice is None and not (recording / "summary.json").is_file():
        files = recordings_of(recording)
    elif recording.is_file():
        raise BadInput(f"{recording} is one recording: --scenario, --planner and --trial choose among those of a run "
                       "folder")
    else:
        files = recordings_for(run_folder_at(recording), scenario, planner, choice)
        if choice is not None and not files:
            files = _played(recording, scenario or most_telling(recording), planner, choice)
    if video is not None:
        _draw(files[0], video)
        return
    open_viewer(files, web=web, screenshot=screenshot, at_s=at,
                say=lambda text: messages.print(text, highlight=False, markup=False, soft_wrap=True))
    say_written(screenshot)


def _played(folder: Path, scenario: str, planner: str | None, choice: TrialChoice) -> tuple[Path, ...]:
    """The recordings of a trial that the run did not record, of each plan that is asked for: it is played again."""
    check_folder(folder / "recordings", "RUN")
    load_libraries()
    with loading():
        from sva_bench.study.replay import Wanted, replay

    wanted = Wanted(scenario=scenario, trial=choice.trial, kind=choice.kind, planner=planner)
    with progress_bars() as progress, local_workers(None, PRELOAD) as executor:
        found = replay(folder, wanted, executor, progress)
    return tuple(one.recording for one in found if one.recording is not None)


def _draw(recording: Path, video: Path) -> None:
    with loading():
        from sva_bench.recording.video import kind_of, video_of
        from sva_bench.recording.viewer import verify

    kind = kind_of(video)
    verify(recording)
    with progress_bars() as progress:
        content = video_of(recording, kind, lambda done, of: progress("drawing", done, of))
    write_result(video, content)
    messages.print(f"{escape(recording.name)} drawn into [bold]{escape(str(video))}[/bold]", highlight=False,
                   soft_wrap=True)


def report(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run, or of a batch.", show_default=False)],
    compare: CompareKeys = None,
    csv: AsCsv = False,
    wide: Wide = False,
    verbose: Verbose = False,
) -> None:
    """Write the report of a finished run or batch again, from its tables.

    Of a batch, --compare says which value of a varied key is worth more, without running anything again.
    """
    with loading():
        from sva_bench.batch.folder import is_batch
        from sva_bench.storage.stored_run import write_csv
        from sva_bench.study.publish import report_again

    set_up_logging(verbose)
    if folder.is_dir():  # else it is said what is missing
        check_output(folder / "report.html", way_out="make the folder writable")
        if is_batch(folder):
            _report_of_batch(folder, compare, csv=csv, wide=wide)
            return
        if compare:
            raise BadInput(f"--compare {compare[0]}: {folder} is no folder of a batch, which alone has values of a key "
                           "to compare")
    page = report_again(folder)
    if csv:
        write_csv(folder)
    messages.print(f"written to [bold]{escape(str(page))}[/bold]", highlight=False)


def _report_of_batch(folder: Path, compare: list[str] | None, *, csv: bool, wide: bool) -> None:
    """Write the report of a batch again; what is compared is printed too."""
    with loading():
        from sva_bench.batch.compared import asked_of
        from sva_bench.batch.folder import settings_in
        from sva_bench.batch.grid import grid_of
        from sva_bench.batch.run import report_again
        from sva_bench.batch.tables import write_tables
        from sva_bench.cli.watching import print_compared

    grid = grid_of(*settings_in(folder))
    summary = report_again(grid, folder, asked_of(compare or (), grid))
    if csv:
        write_tables(folder, summary)
    print_compared(summary.compared, results(), wide=wide)
    messages.print(f"written to [bold]{escape(str(folder / 'report.html'))}[/bold]", highlight=False)
