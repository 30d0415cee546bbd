"""A plan made by hand, checked, then driven beside ours under the same failures and noise."""

import json
from pathlib import Path

import sva_bench as sb

WORLD = Path(__file__).with_name("two-rooms.yaml")
BY_HAND = {"uv1": ["base", "p2", "p1", "base"], "uv2": ["base", "p3", "base"]}  # both leave, each by its own half

world = sb.load_world(WORLD)
instance = sb.make_instance(world)
Path("by-hand.json").write_text(json.dumps({"format": "sva-bench/plan@1", "routes": BY_HAND}))

certificate = sb.certify(instance, "by-hand.json")
print(f"by hand: {'feasible' if certificate.feasible else certificate.reasons}, "
      f"expected value {certificate.expected:.1f}")

plans = {"by hand": "by-hand.json", "stochastic": sb.plan(instance)}
result = sb.execute(world, plans, trials=1000, seed=0)
(scenario,) = result.summary.scenarios
for name, figures in scenario.plans.items():
    low, high = figures.executed.ci95
    print(f"{name}: executed {figures.executed.mean:.1f} [{low:.1f}, {high:.1f}]")
(pair,) = scenario.comparisons
print(f"{pair.a} less {pair.b}: {pair.mean:.1f} [{pair.ci95[0]:.1f}, {pair.ci95[1]:.1f}], {pair.verdict}")
