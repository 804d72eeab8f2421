"""Trim the ends of an episode: what is kept of its recording is extracted anew, and the recording itself stays."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from app.perception.base import GivenPoses, ObjectQuery
from app.pipeline.findings import rules
from app.pipeline.findings.recording import upload_findings
from app.pipeline.findings.units import check_recording
from app.pipeline.keyframes import Motion
from app.pipeline.thresholds import GRASPED_M
from app.services.compared import compared
from app.services.extract import keyframes_of
from app.services.task_settings import TaskSettings
from app.services.teach.upload_checks import MAX_COMPARED
from app.store import episodes
from app.store.records import EpisodeRecord, Extraction
from app.store.store import Store
from app.store.trajectories import get_trajectory
from app.store.values import JsonObject
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.quaternions import angle_between_rad

MIN_FRAMES = 2
MOVED_M = 0.01  # an object by its track, or the hand near an object: what moves less does nothing
TURNED_RAD = math.radians(5.0)  # an object by its track
KEPT_CODES = (rules.OTHER_OBJECTS.code,)  # findings that do not follow from the motion


def trimmed(
    store: Store, record: EpisodeRecord, settings: TaskSettings, ends: Mapping[str, float | None] | None
) -> tuple[Extraction, dict[str, Any]]:
    """Return what is extracted from the kept part, and the episode's changed fields.

    Args:
        ends: `start_s` and `end_s` in seconds of the whole recording, None: its end; None: keep all of it.

    Raises:
        InvalidInputError: if the ends are not within the recording, an object may have been moved before the new
            beginning, or the kept part is no demonstration.
    """
    with store.read() as connection:
        whole = get_trajectory(connection, record.id, whole=True)
        stored = episodes.demonstrations(connection, record.task, MAX_COMPARED)
    recorded = settings.motion_of(whole, record.control_frequency_hz)
    queries = tuple(ObjectQuery.from_json(item) for item in record.given_objects)
    trim = None if ends is None else _kept(recorded, ends)
    if trim is not None:
        _check_unmoved(recorded, trim["first_frame"], [query.name for query in queries], record)
    new = replace(record, trim=trim)
    part = whole if trim is None else whole.part(trim["first_frame"], trim["end_frame"])
    motion = settings.motion_of(part, record.control_frequency_hz)
    given = GivenPoses().estimate([query for query in queries if query.position_m is not None], ())
    check_recording(motion, given, [item.camera() for item in record.cameras])
    extraction = Extraction(record.id, keyframes_of(motion, settings), record.objects, settings.extraction_keys)
    demonstration = replace(new, keyframes=extraction.keyframes, objects=extraction.objects).demonstration()
    findings = upload_findings(
        demonstration,
        motion,
        settings.keyframes.keyframe_rule(),
        tracked=[query.name for query in queries],
        compared=compared(queries, demonstration.objects, settings),
        extra=new.kept_extra or {},
        others=[item.demonstration() for item in stored if item.id != record.id],
    )
    kept = [item for item in record.findings or () if item["code"] in KEPT_CODES]
    found = (*kept, *(finding.to_json() for finding in findings))
    return extraction, {"trim": trim, "num_frames": len(part), "findings": found}


def _kept(motion: Motion, ends: Mapping[str, float | None]) -> JsonObject | None:
    """The kept frames and their times; None for all of them."""
    times_s, start_s, end_s = motion.times_s, ends.get("start_s") or 0.0, ends.get("end_s")
    first = int(np.searchsorted(times_s, start_s - 1e-6))
    end = len(times_s) if end_s is None else int(np.searchsorted(times_s, end_s + 1e-6))
    if end - first < MIN_FRAMES:
        message = f"keeps {max(0, end - first)} frames"
        raise InvalidInputError("trim", message, f"a part of 0 to {times_s[-1]:.3f} s with {MIN_FRAMES} frames or more")
    if (first, end) == (0, len(times_s)):
        return None
    kept_s = {"start_s": round(float(times_s[first]), 6), "end_s": round(float(times_s[end - 1]), 6)}
    return {**kept_s, "first_frame": first, "end_frame": end}


def _check_unmoved(motion: Motion, first: int, names: Sequence[str], record: EpisodeRecord) -> None:
    """Refuse a beginning before which an object may have been moved: its pose is that of the first frame.

    Raises:
        InvalidInputError: naming the object or the gripper.
    """
    remedy = "a beginning before the robot touches an object"
    trajectory = motion.trajectory
    if trajectory.num_objects == len(names):
        for before, after in zip(trajectory.objects_at(0, names), trajectory.objects_at(first, names), strict=True):
            if _is_moved(before, after):
                raise InvalidInputError("trim.start_s", f"lies after {before.name} was moved", remedy)
        if trajectory.object_quaternions_xyzw is not None:
            return
    if any(switch.frame <= first for switch in motion.acting_switches):
        raise InvalidInputError("trim.start_s", "lies after the gripper opened or closed", remedy)
    for pose in [item.pose() for item in record.objects]:
        if _moved_near_m(motion, first, pose) > MOVED_M:
            raise InvalidInputError("trim.start_s", f"lies after the hand came near {pose.name}", remedy)


def _is_moved(before: ObjectPose, after: ObjectPose) -> bool:
    if np.linalg.norm(after.position_m - before.position_m) > MOVED_M:
        return True
    if before.quaternion_xyzw is None or after.quaternion_xyzw is None:
        return False
    return angle_between_rad(before.quaternion_xyzw, after.quaternion_xyzw) > TURNED_RAD


def _moved_near_m(motion: Motion, first: int, pose: ObjectPose) -> float:
    """How far the hand moves near an object before frame `first`."""
    positions_m = motion.trajectory.positions_m[: first + 1]
    steps_m = np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
    is_near = np.linalg.norm(positions_m[1:] - pose.position_m, axis=1) < GRASPED_M
    return float(steps_m[is_near].sum())
