"""The report of a run: one self-contained page."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sva_bench.mission.plan import Plan
from sva_bench.world.model import World

_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#1b1b1b}
h1{font-size:1.6rem}h2{font-size:1.2rem;margin-top:2rem}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}
th,td{padding:.3rem .7rem;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}
th:first-child,td:first-child,.text{text-align:left}td.text{white-space:normal}svg{max-width:100%;height:auto}
.note{color:#555}code{background:#f3f3f3;padding:.1rem .3rem}
"""
_COLOURS = {"base": "#000000", "station": "#0072B2", "poi": "#D55E00"}  # Okabe-Ito: told apart by all eyes


def write_report(path: Path, summary: Mapping[str, Any], plans: Mapping[str, Plan], world: World) -> None:
    """Write ``report.html``.

    Args:
        path: Where to.
        summary: Content of ``summary.json``.
        plans: The plans by ``<scenario>-<planner>``.
        world: The world, for its picture.
    """
    scenarios = summary["scenarios"]
    parts = [
        f"<h1>{_text(summary['world'])}: what the plans are worth when robots fail</h1>",
        f"<p>{_text(answer(summary))}</p>",
        f"<p class=note>{summary['trials']} trials of each plan in each scenario, {summary['rollouts']} noise draws, "
        f"fidelity <code>{summary['fidelity']}</code>, seed {summary['seed']}; planned under "
        f"<code>{summary['failure']['plan']}</code>, executed under <code>{summary['failure']['execute']}</code> "
        "failures. Incentive in the units of the world file; 95 % intervals in brackets.</p>",
        *_comparison(scenarios),
        "<h2>Incentive by robot</h2>",
        _table(["scenario", "plan", *world_robots(world)],
               [[s["name"], name, *(f"{plan['by_robot'][r]:.1f}" for r in world_robots(world))]
                for s in scenarios for name, plan in s["plans"].items()]),
        "<h2>From promise to execution</h2>",
        _table(["scenario", "plan", "promised", "assumption", "draws", "out of fuel", "late", "stuck", "executed"],
               [[s["name"], name, *(f"{x:+.1f}" if 0 < k < 6 else f"{x:.1f}"
                                    for k, x in enumerate(plan["ledger"].values()))]
                for s in scenarios for name, plan in s["plans"].items()]),
        "<h2>How the robots ended</h2>",
        _table(["scenario", "plan", "home", "failed", "out of fuel", "late", "stuck"],
               [[s["name"], name, *(str(plan["ends"].get(end, 0)) for end in
                                    ("home", "failed", "out_of_fuel", "late", "stuck"))]
                for s in scenarios for name, plan in s["plans"].items()]),
        "<h2>Routes</h2>",
        _table(["plan", "robot", "route"],
               [[stem, robot, " → ".join(route) or "stays home"]
                for stem, plan in plans.items() for robot, route in plan.routes.items()], text_last=True),
        "<h2>The world</h2>", picture(world),
        "<p class=note>Black: base. Blue: refuelling stations. Orange: points of interest.</p>",
    ]
    _write_page(path, summary["world"], parts)


def _write_page(path: Path, title: str, parts: Sequence[str]) -> None:
    body = "\n".join(parts)
    path.write_text(
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{_text(title)} · sva-bench</title><style>{_STYLE}</style></head>\n"
        f"<body>\n{body}\n</body></html>\n", encoding="utf-8")


def _comparison(scenarios: Sequence[Mapping[str, Any]]) -> list[str]:
    """The tables that say which plan is worth more."""
    if all("vss" in scenario for scenario in scenarios):
        head = ["scenario", "stochastic, executed", "deterministic, executed", "VSS, executed", "VSS, modelled", "EVPI"]
        return ["<h2>Value of the stochastic solution</h2>", _table(head, [_vss_row(s) for s in scenarios])]
    rows = [[s["name"], name, f"{plan['expected']:.1f}", with_interval(plan["executed"])]
            for s in scenarios for name, plan in s["plans"].items()]
    parts = ["<h2>What the plans are worth</h2>", _table(["scenario", "plan", "expected", "executed"], rows)]
    pairs = [[s["name"], f"{c['a']} − {c['b']}", verdict(c)] for s in scenarios for c in s["comparisons"]]
    if pairs:
        parts += ["<h2>Differences, trial by trial</h2>", _table(["scenario", "plans", "difference"], pairs)]
    return parts


def verdict(difference: Mapping[str, Any]) -> str:
    """A difference with its interval, or that there is none to speak of."""
    if difference["ci95"] is None:
        return f"{difference['mean']:.1f}, no interval"
    return with_interval(difference) if difference["distinguishable"] else "not distinguishable from zero"


def write_batch_report(path: Path, summary: Mapping[str, Any]) -> None:
    """Write the ``report.html`` of a batch.

    Args:
        path: Where to.
        summary: Content of the batch's ``summary.json``.
    """
    over = [[row["scenario"], str(row["maps"]), with_interval(row["vss"]),
             "" if row["vss_pct"]["mean"] is None else with_interval(row["vss_pct"])] for row in summary["aggregate"]]
    parts = [
        f"<h1>Value of the stochastic solution over {_number(len(summary['worlds']), 'map')}</h1>",
        f"<p class=note>{summary['trials']} trials of each plan in each scenario, fidelity "
        f"<code>{summary['fidelity']}</code>; 95 % intervals in brackets. Over maps, the maps are the sample.</p>",
        _table(["scenario", "maps", "VSS", "VSS [%]"], over),
        "<h2>Map by map</h2>",
        _table(["map", "seed", "scenario", "stochastic", "deterministic", "VSS", "VSS, modelled", "EVPI"],
               [[unit["world"], str(unit["seed"]), *_vss_row(s)] for unit in summary["units"]
                for s in unit["scenarios"]]),
    ]
    _write_page(path, "batch", parts)


def answer(summary: Mapping[str, Any]) -> str:
    """In one sentence: which plan is worth more, and by how much."""
    if not all("vss" in scenario for scenario in summary["scenarios"]):
        if len(summary["scenarios"][0]["plans"]) == 1:
            return "One plan: there is nothing to compare it with."
        clear = [f"{c['a']} against {c['b']} in {s['name']} ({c['mean']:+.1f})" for s in summary["scenarios"]
                 for c in s["comparisons"] if c["distinguishable"]]
        return f"Differences that stand out of the noise: {'; '.join(clear)}." if clear else \
            "No difference between plans stands out of the noise."
    pays = [s for s in summary["scenarios"] if s["vss"]["distinguishable"] and s["vss"]["executed"]["mean"] > 0]
    if not pays:
        return "In no scenario can the executed incentives of the two plans be told apart."
    named = ", ".join(f"{s['name']} ({s['vss']['executed_pct']:.0f} %)" for s in pays)
    return f"Planning for failures pays in {named}: share of the stochastic plan's executed incentive that the " \
           "deterministic plan misses."


def world_robots(world: World) -> list[str]:
    """Names of the robots."""
    return [robot.name for robot in world.robots]


def _vss_row(scenario: Mapping[str, Any]) -> list[str]:
    vss = scenario["vss"]
    shown = [with_interval(scenario["plans"][name]["executed"]) for name in ("stochastic", "deterministic")]
    return [scenario["name"], *shown, verdict(vss["executed"] | {"distinguishable": vss["distinguishable"]}),
            f"{vss['modelled']:.1f}", "" if scenario["evpi"] is None else f"{scenario['evpi']:.1f}"]


def with_interval(estimate: Mapping[str, Any]) -> str:
    """``39.0 [36.1, 41.9]``."""
    interval = estimate["ci95"]
    return f"{estimate['mean']:.1f}" + ("" if interval is None else f" [{interval[0]:.1f}, {interval[1]:.1f}]")


def picture(world: World) -> str:
    """The world from above, to scale, as SVG."""
    x0, y0, x1, y1 = world.obstacles.bounds_m.tolist()
    shapes = [f'<rect x="{x0}" y="{-y1}" width="{x1 - x0}" height="{y1 - y0}" fill="#fff" stroke="#444" '
              'stroke-width="0.1"/>']
    for x, y, hx, hy, yaw in world.obstacles.boxes.tolist():
        shapes.append(f'<rect x="{-hx:g}" y="{-hy:g}" width="{2 * hx:g}" height="{2 * hy:g}" fill="#999" '
                      f'transform="translate({x:g} {-y:g}) rotate({-math.degrees(yaw):g})"/>')
    shapes += [f'<circle cx="{x:g}" cy="{-y:g}" r="{r:g}" fill="#999"/>'
               for x, y, r in world.obstacles.cylinders.tolist()]
    size = max(x1 - x0, y1 - y0) / 45
    for site in world.sites:
        shapes.append(f'<circle cx="{site.x_m:g}" cy="{-site.y_m:g}" r="{size / 2:g}" fill="{_COLOURS[site.kind]}"/>'
                      f'<text x="{site.x_m + 0.7 * size:g}" y="{-site.y_m - 0.4 * size:g}" font-size="{1.2 * size:g}" '
                      f'font-family="sans-serif">{_text(site.name)}</text>')
    edge = 0.2
    return (f'<svg role="img" aria-label="the world from above" width="640" '
            f'viewBox="{x0 - edge:g} {-y1 - edge:g} {x1 - x0 + 2 * edge:g} {y1 - y0 + 2 * edge:g}">'
            + "".join(shapes) + "</svg>")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], *, text_last: bool = False) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        last = len(cells) - 1
        return "<tr>" + "".join(
            f"<{tag}{' class=text' if text_last and k in (1, last) else ''}>{_text(cell)}</{tag}>"
            for k, cell in enumerate(cells)) + "</tr>"

    body = "".join(row(cells, "td") for cells in rows)
    return f"<div class=wide><table><thead>{row(head, 'th')}</thead><tbody>{body}</tbody></table></div>"


def _number(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _text(value: object) -> str:
    return html.escape(str(value))
