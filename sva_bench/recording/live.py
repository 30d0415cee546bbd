"""Drives shown in the viewer as they are made."""

from __future__ import annotations

from sva_bench.execution.outcome import Driven
from sva_bench.recording.colors import ROBOT_COLORS
from sva_bench.recording.drawn import write_drive, write_ground
from sva_bench.recording.layout import layout_of_drives
from sva_bench.recording.rerun import Pen, pen_to_viewer
from sva_bench.recording.story import eye_of, ground_of
from sva_bench.world.model import World


class Live:
    """Shows drives one after the other: of each robot, or kind of robots, on a clock that says how long it has driven.

    Hops from site to site come as they are done, in no order; which plan they belong to is decided later.
    """

    def __init__(self, world: World, pen: Pen) -> None:
        self._pen, self._driven_s = pen, dict[str, float]()
        named = [(name, robot) for robot in world.robots for name in (robot.name, world.kind_of(robot))]
        self._radii = {name: robot.model.radius_m for name, robot in named}
        names = list(self._radii)
        self._colors = {name: ROBOT_COLORS[k // 2 % len(ROBOT_COLORS)] for k, name in enumerate(names)}
        pen.lay_out(layout_of_drives(f"{world.name}, as robots drive", names, *eye_of(world)))
        write_ground(pen, *ground_of(world))

    def __call__(self, who: str, driven: Driven) -> None:
        """Show a drive of a robot, or of a kind of robots."""
        begun_s = self._driven_s.get(who, 0.0)
        # The clock of poses begins anew with each leg.
        before_s = [float(driven.leg_s[:leg].sum()) for leg in driven.leg_of.astype(int).tolist()]
        time_s = begun_s + driven.clock_s + before_s
        write_drive(self._pen, f"world/drives/{who}", time_s, driven.pose, self._radii[who], self._colors[who])
        self._driven_s[who] = begun_s + float(driven.leg_s.sum())


def connected(world: World, port: int) -> Live:
    """What shows drives in the viewer that listens at a port of this machine."""
    return Live(world, pen_to_viewer(f"sva-bench {world.name} live", port))
