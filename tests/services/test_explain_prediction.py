"""A recorded prediction beside its demonstrations, in numbers, and the path of the arm as its page previews it."""

from datetime import UTC, datetime

import numpy as np
import pytest

from app.services.predict.demonstrations import Demonstrations
from app.services.predict.evidence import explain_prediction, path_of
from app.services.task_settings import TaskSettings
from app.store.records import DemonstrationRecord, PredictionRecord
from app.store.values import KeyframeRecord, ObjectRecord
from roboprompt_client.arms.named import PandaGeometry

DOWN = (1.0, 0.0, 0.0, 0.0)
INSTRUCTION = "pick up the cube"
SHOWN_X_M = (0.1, 0.15, 0.2)


def actions(x_m, dx_m=0.0, dz_m=(0.1, 0.0, 0.2), is_open=(True, False, False)):
    return [((x_m + dx_m, 0.1, 0.8 + dz), DOWN, opened) for dz, opened in zip(dz_m, is_open, strict=True)]


def cube(x_m, **found):
    return (ObjectRecord("cube", (x_m, 0.1, 0.8), **found),)


def demonstrations():
    return [
        DemonstrationRecord(
            f"{k}", INSTRUCTION, cube(x), tuple(KeyframeRecord(i, *a) for i, a in enumerate(actions(x)))
        )
        for k, x in enumerate(SHOWN_X_M)
    ]


def prediction(predicted, objects, **changes):
    actions = [dict(zip(("position", "quaternion_xyzw", "gripper_open"), action, strict=True)) for action in predicted]
    values = {
        "id": "p", "sequence": 1, "created_at": datetime.now(UTC), "task": "pick", "instruction": INSTRUCTION,
        "model": "m", "representation": "absolute", "prompt_format": "paper", "status": "ok", "request": {},
        "demonstration_ids": ("0", "1", "2"), "prompt_system": "", "prompt_user": "", "reply_text": "", "error": None,
        "actions": tuple(actions), "usage": {}, "timings_ms": {}, "objects": objects,
        "outcome_success": None, "outcome_note": None, "outcome_at": None,
        "grounding": {"instruction": INSTRUCTION}, "findings": (),
    }  # fmt: skip
    return PredictionRecord(**{**values, **changes})


def explained(record, shown=None):
    known = tuple(item.demonstration() for item in (demonstrations() if shown is None else shown))
    return explain_prediction(record, [item.pose() for item in record.objects], Demonstrations(known, known))


def test_objects_and_actions_are_held_against_the_demonstrations():
    evidence = explained(prediction(actions(0.4), cube(0.4)))
    assert evidence.reaches["cube"].beyond_m == pytest.approx(0.2)
    assert [deviation.offset_m for deviation in evidence.deviations] == pytest.approx([0.0] * 3)


def test_without_its_demonstrations_nothing_is_compared():
    nothing = explained(prediction(actions(0.12), cube(0.12)), [])
    assert (nothing.reaches, nothing.deviations) == ({}, ())


BASE = {"robot_base": [-0.3, 0.0, 0.75]}
HAND = {"position": [0.0, 0.0, 1.2], "quaternion_xyzw": DOWN}


def path(predicted, request=None, **settings):
    return path_of(prediction(predicted, cube(0.1), request=request or {}), TaskSettings(**BASE, **settings))


def test_the_arm_comes_from_its_ready_pose_to_where_the_request_says_it_is():
    geometry = PandaGeometry("panda")
    first = path(actions(0.2), {"end_effector": HAND}, arm="panda")[0]
    joints = geometry.way(geometry.ready_rad, np.array([0.3, 0, 0.45]), np.array(DOWN))
    joints = geometry.way(joints, np.array(actions(0.2)[0][0]) - BASE["robot_base"], np.array(DOWN))
    assert (first.reachable, first.nearest) == (True, geometry.nearest_limit(joints))
