"""From a world to the value of the stochastic solution (VSS), stage by stage."""

import sva_bench as sb

world = sb.load_world("worlds/four-rooms.yaml", scenario="S3")  # the second robot comes in 25 % of the missions
costs = sb.fuel_costs(world, times=sb.travel_times(world))
instance = sb.make_instance(world, scenario="S3", costs=costs)

plans = {objective: sb.plan(instance, objective=objective) for objective in ("stochastic", "deterministic")}
checked = {name: sb.certify(instance, plan) for name, plan in plans.items()}
print(plans["stochastic"], checked["stochastic"], sep="\n")

result = sb.execute(world, plans, trials=1000, seed=0)  # in physics, both under the same failures and noise
vss = result.summary.scenario("S3").comparisons[0]
print(f"VSS modelled {checked['stochastic'].expected - checked['deterministic'].expected:.1f}, "
      f"executed {vss.mean:.1f} [{vss.ci95[0]:.1f}, {vss.ci95[1]:.1f}]")

print(result.outcomes.group_by(["planner", "robot"]).aggregate([("incentive", "mean")]).to_pylist())
sb.record(result, "four-rooms-S3.rrd", planner="stochastic")  # sva-bench view four-rooms-S3.rrd
