"""What a recording is of, in figures and in words: plan, trial, seed and result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sva_bench.choices import News, PolicyName, RecordedKind
from sva_bench.execution.outcome import Trace

_CHOSEN: Mapping[RecordedKind, str] = {
    "typical": "a typical one: robots end as they most often do", "median": "the one of median value",
    "worst": "the one of least value", "trial": "asked for", "first": "the first"}
_ENDED: Mapping[str, str] = {
    "home": "came home", "failed": "failed", "out_of_fuel": "ran out of fuel", "late": "came home late",
    "stuck": "got stuck"}


@dataclass(frozen=True, kw_only=True)
class About:
    """What a recording is of.

    Attributes:
        scenario, planner: Whose plan, in which scenario.
        trial: Number of the trial, or of the history.
        seed: Seed of the run.
        fidelity: How it was executed.
        kind: How the trial was chosen.
        policy, news: What the team does about failures.
    """

    scenario: str
    planner: str
    trial: int
    seed: int
    fidelity: str
    kind: RecordedKind = "trial"
    policy: PolicyName = "none"
    news: News = "never"

    def properties(self, world: str, traces: Sequence[Trace]) -> dict[str, str | int | float]:
        """Properties of the recording, by which recordings can be told apart and sorted."""
        return {"world": world, "scenario": self.scenario, "planner": self.planner, "policy": self.policy,
                "news": self.news, "trial": self.trial, "seed": self.seed, "fidelity": self.fidelity,
                "chosen": self.kind, "value": round(sum(trace.outcome.value for trace in traces), 6),
                "incentive": round(sum(trace.outcome.incentive for trace in traces), 6),
                "lost": sum(trace.outcome.lost for trace in traces)}

    def text(self, world: str, traces: Sequence[Trace]) -> str:
        """The same for people, as Markdown, with how each robot ended."""
        reacts = "" if self.policy == "none" else f", team reacts: {self.policy} on {self.news} news"
        value = sum(trace.outcome.value for trace in traces)
        head = (f"**{world}, scenario {self.scenario}, {self.planner} plan**{reacts}\n\n"
                f"Trial {self.trial} ({_CHOSEN[self.kind]}), seed {self.seed}, {self.fidelity}. "
                f"**Result: {_figure(value)}**\n\n")
        return head + results_table(traces)


def legend(*, changed: bool, believed: bool, lost: bool, forgone: bool, touched: bool) -> str:
    """What the marks on the map mean, as Markdown; those of what didn't happen are left out."""
    said = ["yellow: POI, larger if worth more; in a robot's colour: collected by it", "green: station", "black: base",
            "dashes: planned", "line: driven"]
    said += ["thin: orders before news", "thick: after it", "pale: taken over"] if changed else []
    said += ["ring: where a robot believes to be"] if believed else []
    said += ["red cross: lost robot"] if lost else []
    said += ["other cross: POI left by the robot of its colour"] if forgone else []
    said += ["red dot: a hull touched something"] if touched else []
    return f"*Marks: {'; '.join(said)}.*"


def results_table(traces: Sequence[Trace]) -> str:
    """How each robot ended, as a Markdown table."""
    rows = ["| robot | end | at | collected |", "| --- | --- | --- | --- |"]
    for trace in traces:
        outcome = trace.outcome
        never = outcome.end == "home" and not outcome.events
        rows.append(f"| {trace.orders.robot} | {'stayed home' if never else _ENDED[outcome.end]} | "
                    f"{outcome.end_time_s:.0f} s | {_figure(outcome.incentive)} |")
    return "\n".join(rows)


def _figure(value: float) -> str:
    return f"{round(value, 2):g}"
