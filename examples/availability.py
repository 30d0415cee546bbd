"""How reliable must the second robot be before it pays to rely on it? The modelled VSS for eleven availabilities."""

import json
from pathlib import Path

import sva_bench as sb

WORLD = Path(__file__).with_name("two-rooms.yaml")

sb.make_instance(WORLD, output="instance.json")
numbers = json.loads(Path("instance.json").read_text())  # all that a solver needs: docs/formats.md

print("available  stochastic  deterministic   VSS")
for percent in range(0, 101, 10):
    numbers["vehicles"][1]["availability"] = percent / 100
    Path("instance.json").write_text(json.dumps(numbers))
    expected = {objective: sb.certify("instance.json", sb.plan("instance.json", objective=objective)).expected
                for objective in ("stochastic", "deterministic")}
    vss = expected["stochastic"] - expected["deterministic"]
    print(f"{percent:7} %  {expected['stochastic']:10.1f}  {expected['deterministic']:13.1f}  {vss:4.1f}")
