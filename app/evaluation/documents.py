"""Trials <-> the JSON documents that an evaluation keeps."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from app.evaluation.records import Crash, Trial
from app.pipeline.episode import EndEffectorAction, ObjectPose
from app.pipeline.metadata import object_json
from app.sim.demonstrate import RolloutResult, SceneView

Document = Mapping[str, Any]


def document_of(outcome: Trial | Crash) -> Document:
    """What is kept of a trial: everything but pictures, which its actions give again."""
    if isinstance(outcome, Crash):
        return {"status": "error", **asdict(outcome)}
    execution = outcome.execution
    return {
        "status": "success" if outcome.succeeded else "failure",
        "task": outcome.task,
        "seed": outcome.seed,
        "method": outcome.method,
        "failure": outcome.failure,
        "instruction": outcome.scene.instruction,
        "objects": [object_json(pose) for pose in outcome.scene.objects],
        "actions": [_action_json(action) for action in outcome.actions],
        "num_executed": None if execution is None else execution.num_executed,
        "predict_s": outcome.predict_s,
        "execute_s": outcome.execute_s,
        "answer": outcome.answer,
        "shift_m": outcome.shift_m,
    }


def outcome_of(document: Document) -> Trial | Crash:
    """The inverse of `document_of`."""
    names = ("task", "seed", "method")
    task, seed, method = (document[name] for name in names)
    if document["status"] == "error":
        return Crash(task, seed, method, document["message"])
    execution, num_executed = None, document["num_executed"]
    if num_executed is not None:
        succeeded = document["status"] == "success"
        execution = RolloutResult(task, seed, num_executed, succeeded, document["failure"], film_strip=())
    return Trial(
        task,
        seed,
        method,
        _scene(document),
        answer=document["answer"],
        error="" if execution else document["failure"],
        execution=execution,
        predict_s=document["predict_s"],
        execute_s=document["execute_s"],
        actions=tuple(_action(item) for item in document["actions"]),
        shift_m=document.get("shift_m", 0.0),
    )


def _scene(document: Document) -> SceneView:
    objects = [ObjectPose(item["name"], item["position"], item["quaternion_xyzw"]) for item in document["objects"]]
    return SceneView(document["task"], document["seed"], document["instruction"], tuple(objects), (), {})


def _action_json(action: EndEffectorAction) -> Document:
    return {
        "position": action.position_m.tolist(),
        "quaternion_xyzw": action.quaternion_xyzw.tolist(),
        "gripper_open": action.gripper_open,
    }


def _action(item: Document) -> EndEffectorAction:
    return EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])
