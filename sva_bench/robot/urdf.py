"""Robots described in URDF: links and joints in numbers, whatever else the file holds.

Source:
    http://wiki.ros.org/urdf/XML; frames as REP 103 has them: x ahead, y to the left, z up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import SolidKind
from sva_bench.errors import BadFile, nearest
from sva_bench.files.printable import shown
from sva_bench.files.xml_text import Element, parse_xml

MAX_BYTES = 5_000_000  # thousands of links
MAX_SOLIDS = 200  # more than a robot of simple solids needs, few enough for physics

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_LARGEST = 1e6  # of any number: metres, kilograms, radians
_SIZES = (1e-4, 100.0)  # least and greatest size of a solid [m]
_LEAST_KG = 1e-6
_TURNING = ("continuous", "revolute")
_LOCKED = ("fixed", "prismatic", *_TURNING)
"""Joints that are held where they are; those of the driven wheels are not."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """A solid that a link collides with.

    Attributes:
        kind: What it is.
        size_m: As of ``Solid``.
        at_m: Its centre in the link [m].
        turned: Its axes in the link, shape (3, 3).
        line: Its line in the file.
    """

    kind: SolidKind
    size_m: tuple[float, float, float]
    at_m: FloatArray
    turned: FloatArray
    line: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Link:
    """A rigid part.

    Attributes:
        name: Its name.
        line: Its line in the file.
        shapes: What it collides with.
        mass_kg: Its mass; 0 = a mere frame [kg].
        centre_m: Centre of that mass in the link [m].
        inertia_kg_m2: Its inertia about that centre, by the link's axes, shape (3, 3) [kg m2].
    """

    name: str
    line: int
    shapes: tuple[Shape, ...]
    mass_kg: float
    centre_m: FloatArray
    inertia_kg_m2: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Joint:
    """What joins a link to its parent.

    Attributes:
        name: Its name.
        line: Its line in the file.
        turns: Whether it turns about its axis.
        parent, child: Names of the links.
        at_m: Origin of the child in the parent [m].
        turned: The child's axes in the parent, shape (3, 3).
        axis: Its axis in the child.
    """

    name: str
    line: int
    turns: bool
    parent: str
    child: str
    at_m: FloatArray
    turned: FloatArray
    axis: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Urdf:
    """A robot's links and joints: a tree.

    Attributes:
        file: Name of the file, for messages.
        links: The links by name.
        joints: The joints by name.
        root: Name of the link that has no parent.
    """

    file: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    root: str

    def joints_below(self) -> dict[str, list[Joint]]:
        """The joints that join others to a link, by its name."""
        return _by_parent(self.joints)


def _by_parent(joints: Mapping[str, Joint]) -> dict[str, list[Joint]]:
    found: dict[str, list[Joint]] = {}
    for joint in joints.values():
        found.setdefault(joint.parent, []).append(joint)
    return found


def read_urdf(content: bytes, file: str) -> Urdf:
    """The robot that a URDF describes.

    Args:
        content: The file's bytes.
        file: Its name, for messages.

    Raises:
        BadFile: If it is no URDF, names meshes, or holds figures that are not finite and positive where they must be.
    """
    root = parse_xml(content, file)
    reader = _Reader(file)
    if root.tag != "robot":
        raise reader.error(root, "", f"expected a URDF, whose outermost element is <robot>, found <{shown_tag(root)}>")
    reader.refuse_xacro(root)
    links, joints = {}, {}
    for element in root.all("link"):
        link = reader.link(element)
        if link.name in links:
            raise reader.error(element, f"link {link.name}", "there is another link of this name; names must differ")
        links[link.name] = link
    for element in root.all("joint"):
        joint = reader.joint(element, list(links))
        if joint.name in joints:
            raise reader.error(element, f"joint {joint.name}", "there is another joint of this name; names must differ")
        joints[joint.name] = joint
    if sum(len(link.shapes) for link in links.values()) > MAX_SOLIDS:
        raise reader.error(root, "", f"it has more than {MAX_SOLIDS} collision shapes; leave out those of small parts")
    return Urdf(file=file, links=links, joints=joints, root=reader.root_of(root, links, joints))


def about(file: str, line: int, key: str, problem: str) -> BadFile:
    """An error about a link or joint of a URDF, whatever its name."""
    return BadFile(file, line, key if key.isprintable() and len(key) <= 80 else shown(key), problem)


def shown_tag(element: Element) -> str:
    """The name of an element as shown in messages."""
    return element.tag if element.tag.isprintable() and len(element.tag) <= 60 else shown(element.tag)


class _Reader:
    """Reads elements; errors name the file and line."""

    def __init__(self, file: str) -> None:
        self._file = file

    def error(self, element: Element, key: str, problem: str) -> BadFile:
        return about(self._file, element.line, key, problem)

    def refuse_xacro(self, root: Element) -> None:
        waiting = [root]
        while waiting:
            element = waiting.pop()
            if element.tag.startswith("xacro:") or any("${" in value for value in element.attributes.values()):
                raise self.error(element, "", "it is written in xacro; expand it first: 'xacro robot.urdf.xacro > "
                                 "robot.urdf'")
            waiting += element.children

    def link(self, element: Element) -> Link:
        name = self._attribute(element, "name", "link")
        key = f"link {name}"
        shapes = tuple(self._shape(collision, key) for collision in element.all("collision"))
        inertial = self._only(element, "inertial", key)
        mass, centre, inertia = (0.0, np.zeros(3), np.zeros((3, 3))) if inertial is None else self._mass(inertial, key)
        if inertial is None and shapes:
            raise self.error(element, key, "it has a collision shape, but no <inertial>; say its mass and inertia")
        return Link(name=name, line=element.line, shapes=shapes, mass_kg=mass, centre_m=centre, inertia_kg_m2=inertia)

    def joint(self, element: Element, links: list[str]) -> Joint:
        name = self._attribute(element, "name", "joint")
        key = f"joint {name}"
        kind = self._attribute(element, "type", key)
        if kind not in _LOCKED:
            raise self.error(element, key, f"a joint of type {shown(kind)} can't be held where it is; let it be one of "
                             f"{', '.join(_LOCKED)}")
        ends = []
        for end in ("parent", "child"):
            one = self._needed(element, end, key)
            link = self._attribute(one, "link", key)
            if link not in links:
                raise self.error(one, key, f"there is no link {shown(link)}; {nearest(link, links)}")
            ends.append(link)
        at, turned = self._origin(element, key)
        axis = np.array([1.0, 0.0, 0.0])
        if (given := self._only(element, "axis", key)) is not None:
            axis = self._vector(given, "xyz", key, np.array([1.0, 0.0, 0.0]))
            if not float(np.linalg.norm(axis)) > 1e-9:
                raise self.error(given, key, "its axis has no direction")
        return Joint(name=name, line=element.line, turns=kind in _TURNING, parent=ends[0], child=ends[1], at_m=at,
                     turned=turned, axis=axis / np.linalg.norm(axis))

    def root_of(self, element: Element, links: Mapping[str, Link], joints: Mapping[str, Joint]) -> str:
        """Name of the link that all others hang on."""
        parents: dict[str, str] = {}
        for joint in joints.values():
            if joint.child in parents:
                raise about(self._file, joint.line, f"joint {joint.name}", f"the link {shown(joint.child)} has another "
                            "parent; links must form a tree")
            parents[joint.child] = joint.parent
        roots = [name for name in links if name not in parents]
        if len(roots) > 1:
            raise self.error(element, "", f"nothing joins the links {shown(roots[0])} and {shown(roots[1])}; let one "
                             "link be the parent of all others")
        reached, waiting, below = set(roots), list(roots), _by_parent(joints)
        while waiting:
            further = [joint.child for joint in below.get(waiting.pop(), ())]
            reached |= set(further)
            waiting += further
        if len(reached) < len(links) or not roots:
            what = "it has no link" if not links else "its joints run in a circle; links must form a tree"
            raise self.error(element, "", what)
        return roots[0]

    def _shape(self, collision: Element, key: str) -> Shape:
        geometry = self._needed(collision, "geometry", key)
        at, turned = self._origin(collision, key)
        if len(geometry.children) != 1:
            raise self.error(geometry, key, "expected one shape in <geometry>")
        form = geometry.children[0]
        if form.tag == "mesh":
            raise self.error(form, key, "meshes are not read: replace this collision shape by boxes, cylinders or "
                             "spheres about it; <visual> may keep the mesh")
        if form.tag == "box":
            size = self._vector(form, "size", key, None)
            sizes, kind = (float(size[0]), float(size[1]), float(size[2])), "box"
        elif form.tag == "cylinder":
            sizes, kind = (self._number(form, "radius", key), self._number(form, "length", key), 0.0), "cylinder"
        elif form.tag == "sphere":
            sizes, kind = (self._number(form, "radius", key), 0.0, 0.0), "sphere"
        else:
            raise self.error(form, key, f"unknown shape <{shown_tag(form)}>; known: box, cylinder, sphere")
        count = {"box": 3, "cylinder": 2, "sphere": 1}[kind]
        if not all(_SIZES[0] <= size <= _SIZES[1] for size in sizes[:count]):
            raise self.error(form, key, f"the sizes of a solid must be from {_SIZES[0]:g} to {_SIZES[1]:g} m")
        return Shape(kind=kind, size_m=sizes, at_m=at, turned=turned, line=form.line)  # type: ignore[arg-type]

    def _mass(self, inertial: Element, key: str) -> tuple[float, FloatArray, FloatArray]:
        mass_at, inertia_at = self._needed(inertial, "mass", key), self._needed(inertial, "inertia", key)
        mass = self._number(mass_at, "value", key)
        if mass < _LEAST_KG:
            raise self.error(mass_at, key, f"its mass is {mass:g} kg; it must be {_LEAST_KG:g} kg or more. A mere "
                             "frame has no <inertial>")
        centre, turned = self._origin(inertial, key)
        xx, xy, xz, yy, yz, zz = (
            self._number(inertia_at, name, key) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if not float(np.linalg.eigvalsh(inertia).min()) > 0:
            raise self.error(inertia_at, key, "its inertia isn't positive about every axis; a solid of that mass has "
                             "one that is")
        return mass, centre, turned @ inertia @ turned.T

    def _origin(self, element: Element, key: str) -> tuple[FloatArray, FloatArray]:
        origin = self._only(element, "origin", key)
        if origin is None:
            return np.zeros(3), np.eye(3)
        rpy = self._vector(origin, "rpy", key, np.zeros(3))
        return self._vector(origin, "xyz", key, np.zeros(3)), turned_by(*rpy.tolist())

    def _attribute(self, element: Element, name: str, key: str) -> str:
        if name not in element.attributes:
            raise self.error(element, key, f"<{shown_tag(element)}> has no {name}; add it")
        return element.attributes[name]

    def _needed(self, element: Element, tag: str, key: str) -> Element:
        found = self._only(element, tag, key)
        if found is None:
            raise self.error(element, key, f"<{shown_tag(element)}> has no <{tag}>; add it")
        return found

    def _only(self, element: Element, tag: str, key: str) -> Element | None:
        found = element.all(tag)
        if len(found) > 1:
            raise self.error(found[1], key, f"there is another <{tag}> in this <{shown_tag(element)}>; keep one")
        return found[0] if found else None

    def _number(self, element: Element, name: str, key: str) -> float:
        return self._parsed(self._attribute(element, name, key).strip(), element, name, key)

    def _vector(self, element: Element, name: str, key: str, otherwise: FloatArray | None) -> FloatArray:
        if name not in element.attributes and otherwise is not None:
            return otherwise
        words = self._attribute(element, name, key).split()
        if len(words) != 3:
            raise self.error(element, key, f"expected three numbers in {name}, found {shown(' '.join(words))}")
        return np.array([self._parsed(word, element, name, key) for word in words])

    def _parsed(self, word: str, element: Element, name: str, key: str) -> float:
        value = float(word) if len(word) <= 60 and _NUMBER.fullmatch(word) else math.nan
        if not abs(value) <= _LARGEST:
            raise self.error(element, key, f"expected a number of at most {_LARGEST:g} in {name}, found {shown(word)}")
        return value


def turned_by(roll: float, pitch: float, yaw: float) -> FloatArray:
    """The axes of a frame turned about the fixed x, y and z axis in this order, as columns, shape (3, 3)."""
    (a, b, c), (d, e, f) = ([math.cos(t) for t in (roll, pitch, yaw)], [math.sin(t) for t in (roll, pitch, yaw)])
    return np.array([[c * b, c * e * d - f * a, c * e * a + f * d],
                     [f * b, f * e * d + c * a, f * e * a - c * d],
                     [-e, b * d, b * a]])


def rpy_of(turned: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of which ``turned_by`` gives those axes [rad]."""
    level = math.hypot(turned[0, 0], turned[1, 0])
    pitch = math.atan2(-turned[2, 0], level)
    if level < 1e-9:  # seen along the axis of pitch, roll and yaw are one
        return math.atan2(-turned[1, 2], turned[1, 1]), pitch, 0.0
    return math.atan2(turned[2, 1], turned[2, 2]), pitch, math.atan2(turned[1, 0], turned[0, 0])
