"""An arm by its URDF, which may be a stranger's file: the revolute joints from its base to its hand.

Meshes, masses and other branches, such as fingers, are left aside.
"""

from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, TreeBuilder, tostring
from xml.parsers import expat

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.arms.geometry import Chain
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array, bounded_array
from roboprompt_client.types.trajectory import MAX_JOINTS

MAX_CHARS, MAX_WAY = 500_000, 100
DEPTH = 3  # robot, joint, and a part of it
MAX_LINK_M, MAX_ANGLE_RAD = 10.0, 1000.0
FIXED, REVOLUTE, CONTINUOUS = "fixed", "revolute", "continuous"
# What is kept of a joint
USED = {"parent": ["link"], "child": ["link"], "origin": ["xyz", "rpy"], "axis": ["xyz"], "limit": ["lower", "upper"]}


class UrdfGeometry(Chain):
    """The geometry of the arm that a URDF describes.

    Args:
        urdf: the text of the file.
        frame: the link whose pose recordings and actions have.
        base: the link in whose frame they have it, and that does not move against the arm's; None: the outermost link.
        ready_rad: (J,) joints from which other poses are reached; None: 0, or the limit that is nearest to it.

    Attributes:
        names: of the joints, from the base on.
        urdf: what was used of it, as a URDF.

    Raises:
        InvalidInputError: if the text is no URDF, lacks a link, or has other joints than revolute ones between the two;
            if the ready joints are not those of the arm, or beyond their limits.
    """

    def __init__(self, urdf: str, frame: str, base: str | None = None, ready_rad: Array | None = None) -> None:
        back, way = _way_between(_joints_by_child(urdf), base, frame)
        turning = _checked(way, frame)
        self.names, self.urdf = [_name(joint) for joint in turning], _text([*back, *way])
        links = [np.linalg.inv(reduce(np.matmul, map(_origin, back), np.eye(4)))]
        for joint in way:
            links[-1] = links[-1] @ _origin(joint)
            links += [np.eye(4)] if joint in turning else []
        low, high = np.array([_limits(joint) for joint in turning]).T
        ready = np.clip(0.0, low, high) if ready_rad is None else ready_rad
        if len(ready) != len(turning):
            raise InvalidInputError("ready", f"has {len(ready)} joints", f"{len(turning)}: {', '.join(self.names)}")
        for name, angle, least, most in zip(self.names, ready, low, high, strict=True):
            if not least <= angle <= most:
                raise InvalidInputError("ready", f"is {angle:g} rad for {name}", f"{least:g} to {most:g} rad")
        super().__init__(np.array(links), np.array([_axis(joint) for joint in turning]), low, high, ready)

    @classmethod
    def read(cls, path: Path, frame: str) -> "UrdfGeometry":
        """Return the geometry of a file's arm; raises InvalidInputError as the constructor, or if it cannot be read."""
        try:
            return cls(path.read_text(), frame)
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidInputError("urdf", f"{path}: {error}", "a URDF file") from error

    def frame(self, angles_rad: Mapping[str, float]) -> Array:
        """Return the frame's pose (4, 4) for angles by the joints' names; raises MotionError if one is missing."""
        if missing := [name for name in self.names if name not in angles_rad]:
            raise MotionError(f"the URDF's joints {', '.join(missing)} are not among {', '.join(angles_rad)}")
        return self.hand(np.array([angles_rad[name] for name in self.names]))


def _joints_by_child(urdf: str) -> dict[str, Element]:
    """Return the joint that moves each link."""
    if len(urdf) > MAX_CHARS:
        raise InvalidInputError("urdf", f"has {len(urdf)} characters", f"at most {MAX_CHARS}")
    if (robot := _parsed(urdf)).tag != "robot":
        raise InvalidInputError("urdf", f"begins with <{robot.tag:.40}>", "<robot>")
    by_child: dict[str, Element] = {}
    for joint in robot.findall("joint"):
        other = by_child.setdefault(child := _link(joint, "child"), joint)
        if other is not joint:
            raise _wrong(joint, f"moves {child!r:.80}, as {_name(other)} does", "one joint for each link")
    return by_child


def _parsed(urdf: str) -> Element:
    """Return the outermost element. Prefixes need no namespace: files with other programs' tags often declare none."""
    joints, parser = _Joints(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = joints.start, joints.end
    parser.StartDoctypeDeclHandler = _no_doctype
    try:
        parser.Parse(urdf, True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise InvalidInputError("urdf", f"is no XML: {error}", "the text of a URDF file, after xacro") from error
    return joints.builder.close()


class _Joints:
    """Builds the outermost element, its joints, and their parts: all else would only cost time."""

    def __init__(self) -> None:
        self.builder = TreeBuilder()
        self._open: list[str] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self._open.append(tag)
        if self._is_used():
            self.builder.start(tag, attributes)

    def end(self, tag: str) -> None:
        if self._is_used():
            self.builder.end(tag)
        self._open.pop()

    def _is_used(self) -> bool:
        return len(self._open) <= DEPTH and self._open[1:2] in ([], ["joint"])


def _no_doctype(*_: object) -> None:
    """Entities need a DOCTYPE, and a few of them make gigabytes."""
    raise InvalidInputError("urdf", "has a DOCTYPE", "XML without one")


def _way_between(by_child: Mapping[str, Element], base: str | None, frame: str) -> tuple[list[Element], list[Element]]:
    """Return the joints to the base and those to the frame, both from the last link before the two ways part."""
    way, back = _way(by_child, "frame", frame), [] if base is None else _way(by_child, "base", base)
    while way and back and way[0] is back[0]:
        del way[0], back[0]
    if moving := [joint for joint in back if joint.get("type") != FIXED]:
        raise InvalidInputError("base", f"{base!r:.80} moves: {_name(moving[0])}", "a link that does not move")
    return back, way


def _way(by_child: Mapping[str, Element], field: str, link: str) -> list[Element]:
    """Return the joints from the outermost link to `link`."""
    links = {*by_child, *(_link(joint, "parent") for joint in by_child.values())}
    if link not in links:
        raise InvalidInputError(field, f"{link!r:.80} is not in the URDF", ", ".join(sorted(links)) or "joints, links")
    way: list[Element] = []
    while (joint := by_child.get(link)) is not None:
        if len(way) == MAX_WAY:
            raise _wrong(joint, f"is in a circle, or before {MAX_WAY} others", f"a tree, {MAX_WAY} joints high at most")
        way.append(joint)
        link = _link(joint, "parent")
    return way[::-1]


def _checked(way: Sequence[Element], frame: str) -> list[Element]:
    """Return the joints that turn."""
    for joint in way:
        if (kind := joint.get("type")) not in (FIXED, REVOLUTE, CONTINUOUS) or joint.find("mimic") is not None:
            found = f"is {kind!r:.40}" if joint.find("mimic") is None else "follows another"
            raise _wrong(joint, found, f"{FIXED}, {REVOLUTE} or {CONTINUOUS} joints from base to frame")
    turning = [joint for joint in way if joint.get("type") != FIXED]
    if not 1 <= len(turning) <= MAX_JOINTS:
        raise InvalidInputError("frame", f"{frame!r:.80} is moved by {len(turning)} joints", f"1 to {MAX_JOINTS}")
    return turning


def _text(joints: Sequence[Element]) -> str:
    robot = Element("robot", name="arm")
    for name in dict.fromkeys(_link(joint, end) for joint in joints for end in ("parent", "child")):
        SubElement(robot, "link", name=name)
    for joint in joints:
        kept = SubElement(robot, "joint", name=_name(joint), type=joint.get("type", ""))
        for tag, names in USED.items():
            for part in joint.findall(tag)[:1]:
                SubElement(kept, tag, {name: value for name, value in part.items() if name in names})
    return tostring(robot, encoding="unicode")


def _origin(joint: Element) -> Array:
    """Return the joint's frame (4, 4) at 0 rad in that of its parent link."""
    place_m = _numbers(joint, "origin", "xyz", "0 0 0", MAX_LINK_M, "m")
    turn_rad = _numbers(joint, "origin", "rpy", "0 0 0", MAX_ANGLE_RAD, "rad")
    return pose_matrix(place_m, rotations.from_roll_pitch_yaw(*turn_rad))


def _axis(joint: Element) -> Array:
    axis = _numbers(joint, "axis", "xyz", "1 0 0", MAX_LINK_M, "")
    if (length := float(np.linalg.norm(axis))) < 1e-6:
        raise _wrong(joint, f"has the axis {axis.tolist()}", "a direction")
    return axis / length


def _limits(joint: Element) -> tuple[float, float]:
    if joint.get("type") == CONTINUOUS:
        return -np.inf, np.inf
    low, high = (_numbers(joint, "limit", name, "missing", MAX_ANGLE_RAD, "rad", 1)[0] for name in USED["limit"])
    if low >= high:
        raise _wrong(joint, f"has the limits {low:g} to {high:g} rad", "lower below upper")
    return float(low), float(high)


def _numbers(joint: Element, tag: str, name: str, default: str, most: float, unit: str, number: int = 3) -> Array:
    part = joint.find(tag)
    text = default if part is None else part.get(name, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError as error:
        raise _wrong(joint, f"has the {tag} {name} {text!r:.40}", f"{number} numbers") from error
    return bounded_array(f"urdf: joint {_name(joint)}: {tag} {name}", values, (number,), most, unit)


def _link(joint: Element, end: str) -> str:
    part = joint.find(end)
    if part is None or not (link := part.get("link")):
        raise _wrong(joint, f"has no {end} link", f'<{end} link="..."/>')
    return link


def _name(joint: Element) -> str:
    return joint.get("name", "without a name")[:80]


def _wrong(joint: Element, message: str, valid: str) -> InvalidInputError:
    return InvalidInputError("urdf", f"joint {_name(joint)} {message}", valid)
