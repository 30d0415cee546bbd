"""Trials of a run for other programs: a ROS 2 bag."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

from sva_bench.analysis.summaries import ComparisonSummary
from sva_bench.choices import TrialFormat
from sva_bench.errors import BadInput
from sva_bench.recording.about import About
from sva_bench.recording.bag import BagRobot, bag_of
from sva_bench.recording.colors import ROBOT_COLORS
from sva_bench.recording.log import log_of
from sva_bench.recording.states import state_lanes_of
from sva_bench.storage.stored_run import Content, read_content, run_folder_at
from sva_bench.study.costs import plan_costs
from sva_bench.study.replay import Replayed, Wanted, cases_of, play_again
from sva_bench.workers.progress import OnProgress


def export_trial(folder: Path, wanted: Wanted, to: TrialFormat, executor: Executor | None, progress: OnProgress
                 ) -> bytes:
    """Play one trial of a run again, and write it for another program.

    Raises:
        BadInput: If this is no run folder, the run has no such trial, or several plans are meant.
        BadFile: If a file of the folder is damaged.
        NoMcap: If the library that writes bags isn't installed.
    """
    content = read_content(run_folder_at(folder))
    cases = cases_of(folder, content, wanted)
    if len(cases) > 1:
        if isinstance(content.summary, ComparisonSummary) or "stochastic" not in [one.case.planner for one in cases]:
            raise BadInput("--planner: a bag is of one plan, and the run has "
                           + ", ".join(one.case.planner for one in cases))
        cases = [one for one in cases if one.case.planner == "stochastic"]
    (one,) = cases
    costs = plan_costs(content.world, content.manifest.options["planner"], progress)
    return TRIAL_EXPORTS[to](content, play_again(content, costs, one, None, executor))


def as_mcap(content: Content, played: Replayed) -> bytes:
    """A ROS 2 bag of a trial."""
    world, case, summary = content.world, played.case, content.summary
    colors = {robot.name: ROBOT_COLORS[0] for robot in world.robots}  # a bag has no use for colours
    about = About(scenario=case.scenario.name, planner=case.planner, trial=int(played.rows[0]["trial"]),
                  seed=summary.seed, fidelity=summary.fidelity, policy=case.policy, news=case.news)
    robots = [BagRobot(name=trace.orders.robot, time_s=trace.time_s, pose=trace.pose, fuel_s=trace.fuel_s,
                       planned=trace.planned, lane=lane)
              for trace, lane in zip(played.traces, state_lanes_of(played.traces), strict=True)]
    return bag_of(robots, log_of(played.traces, colors, played.news), about.properties(world.name, played.traces))


TRIAL_EXPORTS: dict[TrialFormat, Callable[[Content, Replayed], bytes]] = {"mcap": as_mcap}
"""How a trial is written for others; to add one, add its word to ``choices.TrialFormat`` and its function here."""
