"""Leave-one-out check of a task's demonstrations: each is predicted from the others of its plan."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.pipeline.check.causes import find_causes
from app.pipeline.check.report import EpisodeCheck, Off, PlanCheck, RowCheck, TaskCheck
from app.pipeline.check.settings import symmetry_findings
from app.pipeline.episode import Demonstration
from app.pipeline.groups import by_plan, shown_together
from app.pipeline.keyframes import manner_of
from app.pipeline.keyframes.resting import path_left_m, paths_left_m
from app.pipeline.plans import demonstrated
from app.pipeline.plans.recording import Recording
from app.pipeline.plans.rows import PlanRow, plan_rows, robust_center


def check_demonstrations(recordings: Sequence[Recording]) -> TaskCheck:
    """Predict each demonstration from the others, and return the errors with findings about their causes.

    Args:
        recordings: at least one, of one task; their demonstrations have ids, and the actions of the task's rule.
    """
    demonstrations = demonstrated(recordings)
    shown = {demonstration.id for demonstration in shown_together(demonstrations)}
    of_id = {recording.demonstration.id: recording for recording in recordings}
    groups = sorted(by_plan(demonstrations), key=len, reverse=True)
    plans = tuple(_plan_check(group, of_id, shown=group[0].id in shown) for group in groups)
    rule = recordings[0].rule
    findings, unlike_ids = find_causes(plans, rule)
    return TaskCheck(rule.rule, plans, (*findings, *symmetry_findings(recordings)), unlike_ids)


def _plan_check(group: Sequence[Demonstration], of_id: Mapping[str, Recording], *, shown: bool) -> PlanCheck:
    rows = plan_rows(group)
    errors = [_left_out(row) if len(group) > 1 else [] for row in rows]
    was_open = bool(of_id[group[0].id].motion.phases[0].gripper_open)
    checks = []
    for row, offs in zip(rows, errors, strict=True):
        checks.append(_row_check(group, row, offs, switches=row.gripper_open != was_open))
        was_open = row.gripper_open
    episodes = tuple(
        _episode_check(of_id[demonstration.id], demonstration, [offs[place] for offs in errors if offs])
        for place, demonstration in enumerate(group)
    )
    return PlanCheck(group[0].order.form, shown, tuple(checks), episodes)


def _row_check(group: Sequence[Demonstration], row: PlanRow, offs: list[Off], *, switches: bool) -> RowCheck:
    objects = tuple(dict.fromkeys(name for anchor in row.anchors for name in anchor.names))
    check = RowCheck(objects, row.anchors[0].frame, row.gripper_open, switches, _variation(row))
    if not offs:
        return check
    worst = max(range(len(offs)), key=lambda place: offs[place].together_m)
    error = Off.median([off.m for off in offs], [off.deg for off in offs])
    return replace(check, error=error, worst=offs[worst], worst_id=group[worst].id)


def _episode_check(recording: Recording, demonstration: Demonstration, errors: Sequence[Off]) -> EpisodeCheck:
    manner = recording.manner
    if recording.rule.rule == "waypoints":  # which treats every recording as flowing
        manner = manner_of(recording.motion, recording.rule.delta_rad_s)
    actions, motion = demonstration.actions, recording.motion
    path_m = max(paths_left_m(motion, actions), default=0.0)
    left_m = path_left_m(motion, manner, actions)
    return EpisodeCheck(demonstration.id, demonstration.instruction, actions, manner, tuple(errors), path_m, left_m)


def _left_out(row: PlanRow) -> list[Off]:
    """Return the error of each of at least two demonstrations, predicted by the robust center of the others.

    Both are relative to the row's anchor, where distances and angles are the same as in the demonstration's scene.
    """
    offs = []
    for place, (offset_m, rotation) in enumerate(zip(row.offsets_m, row.rotations, strict=True)):
        others = np.arange(len(row.offsets_m)) != place
        center_m, mean = robust_center(row.offsets_m[others], row.rotations[others])
        turn_deg = float(np.degrees((mean.inv() * rotation).magnitude()))
        offs.append(Off(float(np.linalg.norm(offset_m - center_m)), turn_deg))
    return offs


def _variation(row: PlanRow) -> Off:
    """Return the median distance of the hands from their robust center in the world frame."""
    center_m, mean = robust_center(row.positions_m, row.hands)
    turns_deg = np.degrees((mean.inv() * row.hands).magnitude())
    return Off.median(np.linalg.norm(row.positions_m - center_m, axis=1), turns_deg)
