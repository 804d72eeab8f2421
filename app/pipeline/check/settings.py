"""Findings about a task's settings that do not suit its recordings: keyframe rule, symmetry of objects."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.check.report import EpisodeCheck, PlanCheck
from app.pipeline.findings import Finding
from app.pipeline.keyframes import KeyframeRule
from app.pipeline.keyframes.resting import LEFT_M, leave_path
from app.pipeline.plans.recording import Recording
from app.pipeline.plans.symmetry import ALIKE_DEG, TURNS_DEG, sides_of
from app.pipeline.representation.anchors import Anchor, tilted_objects
from roboprompt_client.types.arrays import Array

MISSED_M = 0.02  # twice what the rules that follow a path allow
MANY_ROWS = 20
RULES_OF_RESTS = ("merged", "authors")
MIN_OF_OTHER_SIDES = 2


def missed_path(plans: Sequence[PlanCheck], rule: KeyframeRule) -> list[Finding]:
    """Return a finding if the rule looks for rests, and recordings have none where the hand turns."""
    if rule.rule not in RULES_OF_RESTS:
        return []
    left_m = [episode.path_left_m for plan in plans for episode in plan.episodes]
    missed_m = [left for left in left_m if left > MISSED_M]
    if 2 * len(missed_m) <= len(left_m):
        return []
    rows = int(np.median([len(plan.rows) for plan in plans for _ in plan.episodes]))
    path_m = float(np.median(missed_m))
    message = (
        f"The rule {rule.rule!r} looks for rests, but {len(missed_m)} recordings do not rest where the hand turns: the"
        f" path through its {rows} keyframes is {100 * path_m:.1f} cm off the recorded one. Set keyframes.rule to"
        " `auto` or `waypoints`."
    )
    numbers = {"path_cm": round(100 * path_m, 2), "recordings": len(missed_m), "keyframes": rows}
    return [Finding("keyframes-miss-the-path", "danger", message, "keyframes.rule", numbers)]


def path_left(plan: PlanCheck, number: int, rule: KeyframeRule) -> list[Finding]:
    """Return a finding if the recorded path leaves the straight lines between keyframes."""
    left_m = {episode.id: episode.path_left_m for episode in plan.episodes}
    if not plan.shown or not leave_path(list(left_m.values())):
        return []
    worst = max(left_m, key=left_m.__getitem__)
    number_left = sum(far_m > LEFT_M for far_m in left_m.values())
    remedy = "Set keyframes.rule to `waypoints`"
    if rule.rule == "waypoints" or (rule.rule == "auto" and _moving(plan.episodes)):
        remedy = f"Lower keyframes.tolerance_m (it is {rule.tolerance_m:g})"
    message = (
        f"In {number_left} of {len(left_m)} recordings the path through the keyframes is more than"
        f" {100 * LEFT_M:.0f} cm off the recorded one where the hand does not rest, in {worst}"
        f" {100 * left_m[worst]:.1f} cm. {remedy}."
    )
    numbers = {"path_cm": round(100 * left_m[worst], 2), "recordings": number_left}
    return [Finding("path-not-kept", "warning", message, f"plans[{number}]", numbers)]


def many_rows(plan: PlanCheck, number: int) -> list[Finding]:
    """Return a finding if a plan has many rows."""
    if not plan.shown or len(plan.rows) <= MANY_ROWS:
        return []
    message = (
        f"{plan.episodes[0].instruction!r} takes {len(plan.rows)} rows, and longer replies fail more"
        " often. Teach the parts as tasks of their own, or raise keyframes.tolerance_m."
    )
    return [Finding("many-rows", "warning", message, f"plans[{number}]", {"rows": len(plan.rows)})]


def recorded_otherwise(episodes: Sequence[EpisodeCheck]) -> list[EpisodeCheck]:
    """Return the episodes of the rarer manner, which explains why they differ."""
    moving = _moving(episodes)
    resting = [episode for episode in episodes if episode.manner == "rests"]
    return min(moving, resting, key=len)


def _moving(episodes: Sequence[EpisodeCheck]) -> list[EpisodeCheck]:
    return [episode for episode in episodes if episode.manner != "rests"]


def symmetry_findings(recordings: Sequence[Recording]) -> Iterator[Finding]:
    """Yield for each object whose grasps are quarter or half turns apart the symmetry that makes them equal."""
    tilted = tilted_objects([recording.demonstration for recording in recordings])
    grasps: dict[str, list[Rotation]] = defaultdict(list)
    for recording in recordings:
        for name, hand in _grasps(recording):
            pose = recording.demonstration.object(name)
            if pose.quaternion_xyzw is not None and name not in tilted:
                grasps[name].append(Rotation.from_quat(Anchor(name, "o").axes_of(pose)).inv() * hand)
    for name, hands in grasps.items():
        found = (_of_symmetry(name, _turns_deg(Rotation.concatenate(hands)), each) for each in TURNS_DEG)
        yield from [finding for finding in found if finding is not None][:1]


def _of_symmetry(name: str, turns_deg: Array, symmetry_deg: float) -> Finding | None:
    left_deg, sides = sides_of(turns_deg, symmetry_deg)
    most_deg = float(np.abs(left_deg).max())
    # a side that one demonstration takes may be a slip
    if most_deg > ALIKE_DEG or len(turns_deg) - np.bincount(sides).max() < MIN_OF_OTHER_SIDES:
        return None
    message = (
        f"The {len(turns_deg)} grasps of {name} come from several sides, which are multiples of {symmetry_deg:g}"
        f" degrees apart to within {most_deg:.0f}. If {name} looks the same after such a turn, set the task's"
        f' yaw_symmetry_deg to {{"{name}": {symmetry_deg:g}}}, so that the grasps become equal.'
    )
    numbers = {"symmetry_deg": symmetry_deg, "grasps": len(turns_deg), "left_deg": round(most_deg, 1)}
    return Finding("object-may-be-symmetric", "info", message, f"yaw_symmetry_deg[{name}]", numbers)


def _grasps(recording: Recording) -> Iterator[tuple[str, Rotation]]:
    """Yield the names of clearly grasped objects, each with the hand's rotation at the grasp."""
    objects = recording.demonstration.ordered_objects
    closing = [phase.last for phase in recording.motion.phases if phase.gripper_open and not phase.ends_open]
    for place, frame in zip(recording.grasped, closing, strict=False):
        if place is not None:
            hand = Rotation.from_quat(recording.motion.trajectory.quaternions_xyzw[frame])
            yield objects[place].name, hand


def _turns_deg(hands: Rotation) -> Array:
    """Return (N,) the angles about the vertical from the first hand to those that are not tilted from it."""
    turns: Array = (hands * hands[0].inv()).as_rotvec(degrees=True)
    about: Array = turns[np.linalg.norm(turns[:, :2], axis=1) <= ALIKE_DEG, 2]
    return about
