"""The check of a task's demonstrations -> the JSON document that clients get, in centimeters and degrees."""

from collections.abc import Collection, Sequence

from app.pipeline.check.report import EpisodeCheck, Off, PlanCheck, ReplyCheck, RowCheck
from app.services.teach.check import CheckedTask
from app.store.values import JsonObject


def check_document(checked: CheckedTask) -> JsonObject:
    """A `TaskCheckOut`."""
    check = checked.check
    return {
        "task": checked.task,
        "rule": check.rule,
        "num_episodes": checked.num_episodes,
        "num_checked": check.num_episodes,
        "findings": [finding.to_json() for finding in checked.findings],
        "plans": [_plan(plan, check.unlike_ids) for plan in check.plans],
        "unlike_episode_ids": list(check.unlike_ids),
        "model": checked.model,
        "replies": [_reply(reply) for reply in checked.replies],
    }


def _plan(plan: PlanCheck, unlike_ids: Collection[str]) -> JsonObject:
    return {
        "instructions": list(plan.instructions),
        "shown": plan.shown,
        "rows": [_row(row) for row in plan.rows],
        "episodes": [_episode(episode, unlike_ids) for episode in plan.episodes],
    }


def _row(row: RowCheck) -> JsonObject:
    named = (("error", row.error), ("worst", row.worst), ("varies", row.varies))
    return {
        "objects": list(row.objects),
        "frame": row.frame,
        "gripper_open": row.gripper_open,
        "switches": row.switches,
        "worst_episode_id": row.worst_id,
        **{f"{name}_cm": None if off is None else _cm(off.m) for name, off in named},
        **{f"{name}_deg": None if off is None else round(off.deg, 1) for name, off in named},
    }


def _episode(episode: EpisodeCheck, unlike_ids: Collection[str]) -> JsonObject:
    return {
        "id": episode.id,
        "instruction": episode.instruction,
        "manner": episode.manner,
        **_errors(episode.errors),
        "path_cm": _cm(episode.path_m),
        "unlike_others": episode.id in unlike_ids,
    }


def _reply(reply: ReplyCheck) -> JsonObject:
    return {
        "episode_id": reply.id,
        "num_actions": reply.num_actions,
        **_errors(reply.errors),
        "problem": reply.problem or None,
        "wrong": reply.is_wrong,
    }


def _errors(errors: Sequence[Off]) -> JsonObject:
    return {"error_cm": [_cm(off.m) for off in errors], "error_deg": [round(off.deg, 1) for off in errors]}


def _cm(distance_m: float) -> float:
    return round(100 * distance_m, 2)
