"""The mission's log: what happened, in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from sva_bench.execution.outcome import Event, Trace
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.recording.colors import ALARM, Color
from sva_bench.recording.reactions import held_told, sentences_of

Level = Literal["DEBUG", "INFO", "WARN", "ERROR"]


@dataclass(frozen=True, kw_only=True)
class LogEntry:
    """An entry of the mission's log, in the colour of its robot."""

    time_s: float
    level: Level
    text: str
    color: Color


def events_of(traces: Sequence[Trace]) -> list[tuple[Event, Trace]]:
    """All events in order of time, each with whose it is."""
    return sorted(((event, trace) for trace in traces for event in trace.outcome.events), key=lambda e: e[0].time_s)


def log_of(traces: Sequence[Trace], colors: Mapping[str, Color], news: Sequence[NewsHeard]) -> tuple[LogEntry, ...]:
    """What happened, in order of time."""
    at_home = [
        LogEntry(time_s=0.0, level="INFO", text=f"{trace.orders.robot} stays home", color=colors[trace.orders.robot])
        for trace in traces if not trace.outcome.events]
    entries = []
    for event, trace in events_of(traces):
        level, text = _sentence(event, trace)
        entries.append(LogEntry(time_s=event.time_s, level=level, text=text, color=colors[trace.orders.robot]))
    told = [LogEntry(time_s=heard.time_s, level="WARN", text=text, color=ALARM if robot is None else colors[robot])
            for heard in news for text, robot in sentences_of(heard)]
    return (*at_home, *sorted([*entries, *told], key=lambda entry: entry.time_s))


def _sentence(event: Event, trace: Trace) -> tuple[Level, str]:
    robot, site = trace.orders.robot, event.site
    earned = f"{round(trace.outcome.incentive, 2):g}"
    match event.kind:
        case "departed":
            return "INFO", f"{robot} left {site}"
        case "arrived":
            return "DEBUG", f"{robot} reached {site}"
        case "waits":
            return "INFO", f"{robot} waits {event.lasts_s:g} s for {event.what} on the way to {site}"
        case "touches":
            return "WARN", f"{robot} touched {event.what}, for {event.lasts_s:.2g} s, on the way to {site}"
        case "collected":
            return "INFO", f"{robot} collected {site}: {round(event.incentive, 2):g}"
        case "refuelled":
            return "INFO", f"{robot} refuelled at {site}"
        case "failed":
            where = "at" if site == _stood_at(trace, event) else "on the way to"
            return "ERROR", f"{robot} failed {where} {site}, with {earned} collected"
        case "out_of_fuel":
            return "ERROR", f"{robot} ran out of fuel on the way to {site}, with {earned} collected"
        case "stuck":
            held = f" ({held_told(event.what)})" if event.what else ""
            return "ERROR", f"{robot} got stuck on the way to {site}{held}, with {earned} collected"
        case "late" if event is trace.outcome.events[-1]:
            return "WARN", f"{robot} came home late, with {earned} collected"
        case "late":
            return "WARN", f"{robot} passed its limit of {trace.orders.mission_limit_s:g} s at {site}: earns no more"
        case "home":
            return "INFO", f"{robot} came home, with {earned} collected"


def _stood_at(trace: Trace, event: Event) -> str:
    """Site that a robot stood at, or was last, when something happened."""
    before = [e.site for e in trace.outcome.events if e.kind in ("departed", "arrived") and e is not event]
    # One that never departed stands where it failed: at the base, sent out or not.
    return before[-1] if before else event.site
