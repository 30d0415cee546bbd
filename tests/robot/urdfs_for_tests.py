"""URDFs of robots: parts to put together, and robots drawn at random."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sva_bench.robot.model import RobotModel
from sva_bench.robot.own_body import derive
from sva_bench.robot.urdf import read_urdf

Point = tuple[float, float, float]


def words(values: Point) -> str:
    return " ".join(repr(float(value)) for value in values)


def inertial(mass: float, size: Point, at: Point = (0, 0, 0), times: float = 1.0) -> str:
    """Of a uniform box, or so many times that inertia."""
    x, y, z = (edge**2 / 12 * mass * times for edge in size)
    return (f'<inertial><origin xyz="{words(at)}"/><mass value="{mass!r}"/><inertia ixx="{y + z!r}" ixy="0" ixz="0" '
            f'iyy="{x + z!r}" iyz="0" izz="{x + y!r}"/></inertial>')


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A box on two wheels with casters: lengths from the middle of the axle, on the axle's height."""

    box_m: Point = (0.40, 0.28, 0.16)
    box_at_m: Point = (0.05, 0.0, 0.09)
    mass_kg: float = 9.0
    centre_m: Point = (0.04, 0.0, 0.06)
    wheel_m: float = 0.06
    wheel_kg: float = 0.4
    track_m: float = 0.32
    casters_m: tuple[float, ...] = (0.22, -0.12)
    base_m: Point = (0.02, 0.0, 0.0)
    """The axle's middle in the root."""

    inertia_times: float = 1.0
    """The hull's inertia, in that of a uniform box."""

    def _in_root(self, at: Point) -> Point:
        return self.base_m[0] + at[0], self.base_m[1] + at[1], self.base_m[2] + at[2]

    def text(self) -> str:
        w, links, joints = self.wheel_m, [], []
        hull = inertial(self.mass_kg, self.box_m, self._in_root(self.centre_m), self.inertia_times)
        links.append(f'<link name="hull">{hull}\n<collision><origin xyz="{words(self._in_root(self.box_at_m))}"/>'
                     f'<geometry><box size="{words(self.box_m)}"/></geometry></collision></link>')
        for name, side in (("left", 1), ("right", -1)):
            links.append(f'<link name="{name}">{inertial(self.wheel_kg, (1.4 * w, 1.4 * w, 0.4 * w))}\n<collision>'
                         f'<geometry><cylinder radius="{w!r}" length="{0.4 * w!r}"/></geometry></collision></link>')
            place = words(self._in_root((0.0, side * self.track_m / 2, 0.0)))
            joints.append(f'<joint name="{name}_joint" type="continuous"><origin xyz="{place}" '
                          f'rpy="{-math.pi / 2!r} 0 0"/><parent link="hull"/><child link="{name}"/>'
                          '<axis xyz="0 0 1"/></joint>')
        for k, x in enumerate(self.casters_m):
            links.append(f'<link name="c{k}">{inertial(0.01 * self.mass_kg, (w / 2, w / 2, w / 2))}\n<collision>'
                         f'<geometry><sphere radius="{w / 4!r}"/></geometry></collision></link>')
            place = words(self._in_root((x, 0.0, -0.75 * w)))
            joints.append(f'<joint name="c{k}_joint" type="fixed"><origin xyz="{place}"/><parent link="hull"/>'
                          f'<child link="c{k}"/></joint>')
        return '<robot name="sample">\n' + "\n".join([*links, *joints]) + "\n</robot>\n"


SAMPLE = Sample()
LIMITS = {"max_speed_m_s": 0.5, "max_turn_rad_s": 2.0, "acceleration_m_s2": 0.5, "turn_acceleration_rad_s2": 3.0}


def model_of_text(text: str, **limits: float) -> RobotModel:
    """The model of a URDF with a left and a right joint."""
    found = derive(read_urdf(text.encode(), "robot.urdf"), "left_joint", "right_joint")
    return RobotModel(name="own", radius_m=found.radius_m, wheel_radius_m=found.wheel_radius_m, track_m=found.track_m,
                      mass_kg=found.body.mass_kg, body=found.body, **(LIMITS | limits))


def random_sample(rng: np.random.Generator) -> tuple[Sample, dict[str, float]]:
    """A robot of any size and shape, and limits to drive it with; it may be one that is refused."""
    def within(low: float, high: float) -> float:
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    length = within(0.12, 2.0)
    width, height = length * within(0.4, 1.6), length * within(0.2, 1.5)
    wheel = length * within(0.08, 0.3)
    mass = 300 * length**3 * within(0.3, 3.0)
    shift = float(rng.uniform(-0.3, 0.3)) * length
    centre = (shift + float(rng.uniform(-0.2, 0.2)) * length, float(rng.uniform(-0.1, 0.1)) * width,
              height * float(rng.uniform(0.1, 0.6)))
    sample = Sample(
        box_m=(length, width, height), box_at_m=(shift, 0.0, height / 2), mass_kg=mass, centre_m=centre, wheel_m=wheel,
        wheel_kg=mass * within(0.005, 0.1), track_m=width * float(rng.uniform(0.7, 1.1)),
        casters_m=(shift + 0.45 * length, shift - 0.45 * length),
        base_m=(float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1))),
        inertia_times=within(0.02, 2.0))
    limits = {"max_speed_m_s": within(0.1, 2.0), "max_turn_rad_s": within(0.3, 4.0),
              "acceleration_m_s2": within(0.2, 2.0), "turn_acceleration_rad_s2": within(0.5, 10.0)}
    return sample, limits
