"""The check of a task's demonstrations -> the JSON document that clients and the page get."""

from collections.abc import Mapping

import numpy as np

from app.pipeline.skill.density import Surprise
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.skill import Skill
from app.services.teach.check import CheckedTask
from app.store.values import JsonObject


def check_document(checked: CheckedTask) -> JsonObject:
    """A `TaskCheckOut`."""
    skills = [checked.skills.of_form(form) for form in checked.skills.forms]
    return {
        "task": checked.task,
        "num_episodes": checked.num_episodes,
        "num_checked": len(checked.skills.recordings),
        "findings": [finding.to_json() for finding in checked.findings],
        "plans": [plan for skill in skills for plan in _plans(skill)],
    }


def _plans(skill: Skill) -> list[JsonObject]:
    left_out: dict[str, Surprise] = {}
    for one in skill.left_out(np.inf):
        left_out.setdefault(one.about, one)
    used = skill.usual
    return [{**_plan(plan, left_out), "used": plan in used} for plan in skill.plans]


def _plan(plan: Plan, left_out: Mapping[str, Surprise]) -> JsonObject:
    return {
        "instructions": list(dict.fromkeys(item.order.text for item in plan.members)),
        "when": [condition.described for condition in plan.when],
        "rows": [_row(plan, k) for k in range(len(plan.rows))],
        "episodes": [
            {"id": item.id, "instruction": item.order.text, "least_probable": _surprise(left_out.get(item.id))}
            for item in plan.members
        ],
    }


def _row(plan: Plan, k: int) -> JsonObject:
    row = plan.rows[k]
    return {
        "follows": plan.followed_by(k),
        "gripper_open": row.gripper_open,
        "switches": k in plan.shown.switches,
        "scatter_cm": round(100 * float(row.scale[:3].max()), 2),
        "scatter_deg": round(float(np.degrees(row.scale[3:].max())), 1),
    }


def _surprise(one: Surprise | None) -> JsonObject | None:
    if one is None:
        return None
    return {"coordinate": one.coordinate, "value": one.value, "low": one.usual[0], "high": one.usual[1], "p": one.p}
