"""The plans as routes on the map, side by side: what drives where, how often, and where robots ended or touched
something."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.analysis.reaction_results import ComparedReaction, ReactionResult
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.arrays import FloatArray
from sva_bench.choices import End
from sva_bench.files.printable import counted
from sva_bench.palette import ROBOTS, hex_of, plan_color
from sva_bench.report.main_tables import named
from sva_bench.report.mark_labels import place_words
from sva_bench.report.marks import marks_of, met_in
from sva_bench.report.overlays import Mark
from sva_bench.report.page import details, heading, note, sentence, text
from sva_bench.report.plan_view import PlanView, frame_of, line
from sva_bench.report.reaction_shares import leads, value_without
from sva_bench.report.styles import MARKS, MARKS_OF_MANY
from sva_bench.report.wording import adjusted, listed, per_cent, reliability_told, vss_verdict, with_interval
from sva_bench.storage.run_folder import made_for
from sva_bench.storage.stored_run import Content
from sva_bench.storage.trial_counts import Ended, Key

AnyScenario = ScenarioSummary | ComparedScenario
Route = Sequence[str]

_MOST_BYTES = 500_000  # of all maps of a page
_MOST_REACTIONS, _MOST_PLANS = 3, 6  # shown of each scenario
_MOST_MARKS = 40  # shown on a map, the most frequent
_LANE = 2.6  # how far the lanes of robots lie apart
_LOST: frozenset[End] = frozenset(("failed", "out_of_fuel", "stuck"))
_RING = 6.0
_CLEAR = 16.0  # farther from others a ring needs not lie
_ALONG = (0.62, 0.72, 0.52, 0.82, 0.42, 0.92)  # where on its leg a ring may lie, the best first
_TOUCHED = {"contact": "touched an obstacle", "collision": "two robots collided", "wait": "waited"}


@dataclass(frozen=True, eq=False, kw_only=True)
class _Shown:
    """A plan on its map.

    Attributes:
        title: What stands above it.
        worth: Its value, executed.
        routes: Route of each robot.
        key: Whose trials tell how often.
        colours: Names of the plan and of those of the same routes, with their positions among the plans compared.
        beside: Plans that it is not distinguishable from, if there are any to be shown for that.
        kept: What it is worth if the team keeps its plan, in the same missions; ``None`` where it does.
    """

    title: str
    worth: Estimate
    routes: Mapping[str, Route]
    key: Key
    colours: Sequence[tuple[str, int]]
    beside: Sequence[str] = ()
    kept: float | None = None


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """A mark: its place and radius in the picture, what it is, its shape, what is said of it, and its word."""

    x: float
    y: float
    radius: float
    kind: str
    shape: str
    said: str
    word: str


def route_maps(content: Content) -> list[str]:
    """The section: a pair of maps for each scenario, that of the most telling one open."""
    scenarios: Sequence[AnyScenario] = content.summary.scenarios
    shown = {scenario.name: list(_plans(content, scenario)) for scenario in scenarios}
    if not any(shown.values()):
        return []
    maps = _Maps(content, [plan for plans in shown.values() for plan in plans])
    telling = _telling(scenarios)
    # The open one comes first into the budget; the page keeps the order of the scenarios.
    drawn: dict[str, str] = {}
    for scenario in sorted(scenarios, key=lambda each: each.name != telling):
        if sum(map(len, drawn.values())) < _MOST_BYTES:
            drawn[scenario.name] = "<div class=maps>" + "".join(map(maps.figure, shown[scenario.name])) + "</div>"
    folded = [drawn[s.name] if len(scenarios) == 1 else details(
        f"<b>{text(s.name)}</b>{sentence(_said(content, s))}", drawn[s.name], opened=s.name == telling)
        for s in scenarios if s.name in drawn]
    left = len(scenarios) - len(drawn)
    more = [note(f"{counted(left, 'more scenario')}: their routes stand in the list of routes.")] if left else []
    if any("informed" in scenario.plans for scenario in scenarios):
        more.append(note("The informed planner has no map: its routes are others for each set of available robots."))
    return [heading("The plans on the map"), *folded, *more, note(maps.legend())]


def _telling(scenarios: Sequence[AnyScenario]) -> str:
    """The scenario in which the plans differ most; rather one in which something is left to chance."""
    def gap(scenario: AnyScenario) -> tuple[bool, float]:
        worth = [plan.executed.mean for plan in scenario.plans.values()]
        chance = any(0 < p < 1 for p in scenario.availability.values())
        return chance and max(worth) > min(worth), max(worth) - min(worth)

    return max(scenarios, key=gap).name


def _said(content: Content, scenario: AnyScenario) -> str:
    known = f" ({reliability_told(content.world, scenario.name, content.summary)})"
    if isinstance(scenario, ComparedScenario):
        one = scenario.comparisons[0] if len(scenario.comparisons) == 1 else None
        return known if one is None else f"{known}: {'' if one.same_plan else 'difference '}{adjusted(one)}"
    return f"{known}: " + ("the same plan" if scenario.vss.same_plan else f"VSS {vss_verdict(scenario.vss)}")


def _plans(content: Content, scenario: AnyScenario) -> Iterator[_Shown]:
    """What is shown of a scenario: its plans, those of the same routes once, and the best for each reaction.

    A plan whose orders no reaction ever changes drives what it drives without, and is shown once.
    """
    alike: dict[tuple[tuple[str, tuple[str, ...]], ...], list[str]] = {}
    for name in scenario.plans:
        routes = content.routes.get((scenario.name, name))
        if routes is not None and name != "informed":  # its routes are others in each outcome
            alike.setdefault(tuple((robot, tuple(route)) for robot, route in routes.items()), []).append(name)
    for names in itertools.islice(alike.values(), _MOST_PLANS):
        first, every = names[0], list(scenario.plans)
        yield _Shown(title=listed([named(scenario, name) for name in names]),
                     worth=scenario.plans[first].executed, routes=content.routes[scenario.name, first],
                     key=(scenario.name, first, "none", "never"), colours=[(name, every.index(name)) for name in names])
    for reaction in itertools.islice((r for r in scenario.reactions or () if r.policy != "none"), _MOST_REACTIONS):
        names = [name for name in _telling_with(reaction) if reaction.plans[name].reacted or name not in scenario.plans]
        for name in names:
            routes = content.routes.get((scenario.name, name)) or content.routes.get(
                (scenario.name, made_for(name, reaction.news)))
            if routes is not None:
                yield _Shown(title=f"{name}, team re-plans on {reaction.news} news",
                             worth=reaction.plans[name].executed, routes=routes,
                             key=(scenario.name, name, reaction.policy, reaction.news),
                             colours=[(name, list(reaction.plans).index(name))],
                             beside=[other for other in names if other != name],
                             kept=value_without(reaction, name))


def _telling_with(reaction: ReactionResult | ComparedReaction) -> list[str]:
    """The best plan for a reaction, and where none is distinguishably best the next one too.

    They stand in the order of the plans, as in any other row of maps: the stochastic one to the left.
    """
    if isinstance(reaction, ComparedReaction):
        names = [row.plan for row in reaction.ranking if row.rank == 1][:2]
    else:
        over = None if leads(reaction) else reaction.best.over
        names = [reaction.best.plan, *([] if over is None else [over])]
    return sorted(names, key=list(reaction.plans).index)


class _Maps:
    """Figures of plans of one run."""

    def __init__(self, content: Content, plans: Sequence[_Shown]) -> None:
        self._content = content
        self._met = met_in(content)
        self._kinds = {robot.name: content.world.kind_of(robot) for robot in content.world.robots}
        self._places = {site.name: (site.x_m, site.y_m) for site in content.world.sites}
        self._numbers = {robot.name: number for number, robot in enumerate(content.world.robots)}
        self._straight = False
        self._frame = frame_of(content.world)
        self._driven = _driven_with_reactions(content)
        self.seen: set[str] = set()  # kinds of marks, for the legend
        self._marks = {plan.key: self._placed(plan) for plan in plans}
        places = np.array([(mark.x, mark.y) for marks in self._marks.values() for mark in marks]).reshape(-1, 2)
        busy = np.concatenate([places + np.array([0.0, up]) for up in (0.0, 3.0, -3.0, -12.0, -15.0)] * 2)
        self._view = PlanView(content.world, content.paths.values(), busy)

    def figure(self, plan: _Shown) -> str:
        """The map of one plan, with its title above and its robots below."""
        ended = self._content.counts.ended.get(plan.key, ())
        reacts = plan.key[2] != "none"
        legs = []
        for robot, route in plan.routes.items():
            for number, ends in enumerate(itertools.pairwise(route)):
                if ends[0] != ends[1]:
                    legs.append(self._leg(robot, number, ends, _share_driven(ended, robot, number, reacts)))
        if reacts:
            legs += self._replanned(plan)
        colours = ";--other:".join(hex_of(plan_color(name, number)) for name, number in plan.colours[:2])
        picture = self._view.picture(f"Routes of the {plan.title} plan in {plan.key[0]}", "".join(legs),
                                     self._drawn_marks(plan))
        lines = "".join([*(self._robot(robot, route, ended) for robot, route in plan.routes.items()),
                         *([] if reacts else self._met_told(plan))])
        worth = f"executed {with_interval(plan.worth)}" + (
            "" if plan.kept is None else f"; {plan.kept:.1f} without re-planning, in the same missions") + (
            f", not distinguishable from the {listed(plan.beside)}" if plan.beside else "")
        return (f'<figure class=map><figcaption style="--plan:{colours}"><b>{text(plan.title)}</b> '
                f"{sentence(worth)}</figcaption>{picture}<ul>{lines}</ul></figure>")

    def legend(self) -> str:
        """What is what on the maps."""
        where = "straight from site to site, for this run folder holds no paths" if self._straight else \
            "along their planned paths, a little to the right of them"
        said = [f"Routes are drawn {where}, with an arrow in the middle of each leg; the fainter, the seldomer it is "
                "driven. ■ base, ▲ refuelling station, ● point of interest; point at a leg, a site or a mark for more."]
        if "ended" in self.seen:
            said.append("✕ in a ring: robots failed, ran out of fuel or got stuck on this leg, in so many per cent of "
                        "missions; where on the leg isn't told.")
        if met := [what for kind, what in _TOUCHED.items() if kind in self.seen]:
            said.append(f"◆ with a number: {' or '.join(met)} there, so many times in all that was driven.")
        if "replanned" in self.seen:
            said.append("Hollow: legs driven only after re-planning.")
        if self.seen & {"ended", *_TOUCHED} and any(key[2] != "none" for key in self._marks):
            said.append("Maps of teams that re-plan leave these marks out.")
        return " ".join(said)

    def _path(self, robot: str, ends: tuple[str, str]) -> FloatArray:
        """Path of a leg in the picture, to the right of the planned one."""
        path = self._content.paths.get((self._kinds[robot], *ends))
        if path is None:
            self._straight = True
            path = np.array([self._places[end] for end in ends])
        return beside(self._frame.at(path), _LANE * (self._numbers[robot] + 0.5))

    def _leg(self, robot: str, number: int, ends: tuple[str, str], share: float | None) -> str:
        path = self._path(robot, ends)
        often = "" if share is None else f", driven in {per_cent(100 * share)} of missions"
        faint = "" if share is None or share >= 1 else f' style="--often:{share:.2f}"'
        kind = self._numbers[robot] % len(ROBOTS)
        return (f'<g class="leg r{kind}"{faint}><title>{text(robot)}, leg {number + 1}: {text(ends[0])} → '
                f'{text(ends[1])}{often}</title><path d="{line(path)}"/>{_arrow(path)}</g>')

    def _replanned(self, plan: _Shown) -> list[str]:
        """Legs that are not of the plan, and were driven after re-planning."""
        planned = {(robot, *ends) for robot, route in plan.routes.items() for ends in itertools.pairwise(route)}
        legs = []
        for robot, origin, destination in sorted(self._driven.get(plan.key, set()) - planned):
            self.seen.add("replanned")
            path = line(self._path(robot, (origin, destination)))
            legs.append(f'<g class="leg replanned r{self._numbers[robot] % len(ROBOTS)}"><title>{text(robot)}, after '
                        f"re-planning: {text(origin)} → {text(destination)}</title>"
                        f'<path d="{path}"/><path class=core d="{path}"/></g>')
        return legs

    def _placed(self, plan: _Shown) -> list[_Placed]:
        """All marks of a plan that is kept: what was met where it was, and rings on legs where these leave room."""
        if plan.key[2] != "none":
            return []
        placed = self._met_marks(plan)
        for found in self._content.counts.ended.get(plan.key, ()):
            route = plan.routes.get(found.robot, ())
            if found.end in _LOST and found.left and found.stops + 1 < len(route):
                placed.append(self._ring(found, (route[found.stops], route[found.stops + 1]), placed))
        return placed

    def _ring(self, found: Ended, ends: tuple[str, str], placed: Sequence[_Placed]) -> _Placed:
        """A mark on a leg on which robots ended away from home."""
        self.seen.add("ended")
        path = self._path(found.robot, ends)
        off = [(mark.x, mark.y) for mark in placed] + self._frame.at(np.array(list(self._places.values()))).tolist()
        x, y = max((_along(path, share)[0].tolist() for share in _ALONG), key=lambda at: min(
            [_CLEAR, *(float(np.hypot(at[0] - ox, at[1] - oy)) for ox, oy in off)]))
        often = _often(found.share)
        shape = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{_RING:.0f}"/><path d="M{x - 3:.1f} {y - 3:.1f}l6 6m0-6l-6 6"/>'
        return _Placed(x=x, y=y, radius=_RING, kind="ended", shape=shape, word=often, said=(
            f"{found.robot} {found.end.replace('_', ' ')} on leg {found.stops + 1}, {ends[0]} → {ends[1]}: {often} of "
            "missions"))

    def _met_marks(self, plan: _Shown) -> list[_Placed]:
        """Marks where robots touched something, or waited."""
        found: list[Mark] = []
        for kind, rows in self._met.items():
            found += marks_of([row for row in rows if (row["scenario"], row["planner"]) == plan.key[:2]], kind)
        marks = []
        for mark in sorted(found, key=lambda each: -each.count)[:_MOST_MARKS]:
            self.seen.add(mark.kind)
            (x, y), = self._frame.at(np.array([[mark.x_m, mark.y_m]])).tolist()
            size = 3.5 + min(2.0, 0.5 * np.log2(mark.count))
            marks.append(_Placed(
                x=x, y=y, radius=size, kind=f"met {mark.kind}", word=str(mark.count),
                said=f"{_TOUCHED[mark.kind]} here, {counted(mark.count, 'time')}{', and got stuck' * mark.stuck}",
                shape=f'<path d="M{x:.1f} {y - size:.1f}l{size:.1f} {size:.1f}l{-size:.1f} {size:.1f}'
                      f'l{-size:.1f} {-size:.1f}z"/>'))
        return marks

    def _drawn_marks(self, plan: _Shown) -> str:
        marks, frame = self._marks[plan.key], self._frame
        words = place_words([(mark.x, mark.y, mark.radius) for mark in marks], [mark.word for mark in marks],
                            self._view.taken, (0.0, 0.0, frame.width, frame.height))
        return "".join(
            f'<g class="{mark.kind}"><title>{text(mark.said)}</title>{mark.shape}'
            f'<text x="{x:.1f}" y="{y + 3.5:.1f}">{text(mark.word)}</text></g>'
            for mark, (x, y) in zip(marks, words, strict=True))

    def _met_told(self, plan: _Shown) -> list[str]:
        """A line below a map that counts all that was met; nothing where nothing was."""
        told = [counted(number, MARKS[kind][2], MARKS_OF_MANY[kind]) for kind, rows in self._met.items()
                if (number := sum((row["scenario"], row["planner"]) == plan.key[:2] for row in rows))]
        draws = counted(self._content.summary.rollouts, "noise draw")
        return [f"<li><span>{listed(told)} under {draws}</span></li>"] if told else []

    def _robot(self, robot: str, route: Route, ended: Sequence[Ended]) -> str:
        """A line of the list below a map: where a robot goes, and how it ends."""
        stops = " → ".join(route[1:-1])
        ends: dict[str, float] = {}
        for found in ended:
            if found.robot == robot:
                how = found.end.replace("_", " ") if found.left else f"{found.end.replace('_', ' ')} before it left"
                ends[how] = ends.get(how, 0.0) + found.share
        told = "" if not stops else ", ".join(f"{how} {_often(share)}" for how, share in ends.items())
        swatch = f'<svg class="k leg r{self._numbers[robot] % len(ROBOTS)}" viewBox="0 0 28 8" aria-hidden=true>' \
                 '<path d="M0 4h28"/></svg>'
        return (f"<li>{swatch}<b>{text(robot)}</b> "
                f"{text(stops) or 'stays home'}{f' <span>({sentence(told)})</span>' if told else ''}</li>")


def _often(share: float) -> str:
    """A share of missions as a mark has it: never 0 %, for it happened."""
    return "< 0.1 %" if share < 0.001 else per_cent(100 * share) if share in (0, 1) or share < 0.9995 else "> 99.9 %"


def _share_driven(ended: Sequence[Ended], robot: str, leg: int, reacts: bool) -> float | None:
    """Share of missions in which a robot sets out on a leg; of a team that re-plans, that it leaves the base."""
    mine = [found for found in ended if found.robot == robot]
    if not mine:
        return None
    return sum(found.share for found in mine if found.left and (reacts or found.stops >= leg))


def _driven_with_reactions(content: Content) -> dict[Key, set[tuple[str, str, str]]]:
    """Robot, origin and destination of all legs that were driven, by plan and reaction, where teams react."""
    legs = content.legs
    found: dict[Key, set[tuple[str, str, str]]] = {}
    for scenario, planner, policy, news, robot, origin, destination in set(zip(
            legs.scenario, legs.planner, legs.policy, legs.news, legs.robot, legs.origin, legs.destination,
            strict=True)):
        if policy != "none":
            found.setdefault((scenario, planner, policy, news), set()).add((robot, origin, destination))
    return found


def beside(path: FloatArray, off: float) -> FloatArray:
    """A line to the right of another, as traffic keeps to it; y grows downwards."""
    steps = np.diff(path, axis=0)
    path = path[np.concatenate([[True], np.hypot(*steps.T) > 1e-6])]
    if len(path) < 2:
        return path
    steps = np.diff(path, axis=0)
    unit = steps / np.hypot(*steps.T)[:, None]
    right = np.column_stack([-unit[:, 1], unit[:, 0]])
    before, after = np.concatenate([right[:1], right]), np.concatenate([right, right[-1:]])
    both = before + after
    length = np.maximum((both * both).sum(axis=1, keepdims=True) / 2, 0.5)  # turns of more than 120 degrees are cut
    moved: FloatArray = path + off * both / length
    return moved


def _along(path: FloatArray, share: float) -> tuple[FloatArray, FloatArray]:
    """A place along a line, and the direction there."""
    steps = np.diff(path, axis=0)
    lengths = np.hypot(*steps.T)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    k = int(np.clip(np.searchsorted(arc, share * arc[-1]), 1, len(path) - 1)) - 1
    unit = steps[k] / max(lengths[k], 1e-9)
    return path[k] + unit * (share * arc[-1] - arc[k]), unit


def _arrow(path: FloatArray) -> str:
    """A head in the middle of a line."""
    if len(path) < 2:
        return ""
    (x, y), (ux, uy) = _along(path, 0.5)
    points = [(x + 5 * ux, y + 5 * uy), (x - 3 * ux - 3.5 * uy, y - 3 * uy + 3.5 * ux),
              (x - 3 * ux + 3.5 * uy, y - 3 * uy - 3.5 * ux)]
    return f'<path class=head d="{line(np.array(points))}z"/>'
