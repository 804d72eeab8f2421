"""What deserves a look in a prediction, found by the numbers."""

from datetime import UTC, datetime

import pytest

from app.services.demonstrations import Demonstrations
from app.services.explain_prediction import explain_prediction
from app.services.task_settings import TaskSettings
from app.store.records import DemonstrationRecord, PredictionRecord
from app.store.values import KeyframeRecord, ObjectRecord

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
    told = [dict(zip(("position", "quaternion_xyzw", "gripper_open"), action, strict=True)) for action in predicted]
    values = {
        "id": "p", "sequence": 1, "created_at": datetime.now(UTC), "task": "pick", "instruction": INSTRUCTION,
        "model": "m", "representation": "absolute", "prompt_format": "paper", "status": "ok", "request": {},
        "demonstration_ids": ("0", "1", "2"), "prompt_system": "", "prompt_user": "", "reply_text": "", "error": None,
        "actions": tuple(told), "usage": {}, "timings_ms": {}, "objects": objects,
        "outcome_success": None, "outcome_note": None, "outcome_at": None,
    }  # fmt: skip
    return PredictionRecord(**{**values, **changes})


def explained(record, shown=None):
    known = tuple(item.demonstration() for item in (demonstrations() if shown is None else shown))
    return explain_prediction(record, Demonstrations(known, known), TaskSettings())


def found(record, shown=None):
    return [(finding.where, finding.title) for finding in explained(record, shown).findings]


def test_what_is_as_shown_deserves_no_look():
    assert found(prediction(actions(0.12), cube(0.12))) == []


def test_less_than_a_bin_deserves_none():
    assert found(prediction(actions(0.207, dx_m=0.009), cube(0.207))) == []


FAULTS = [
    (prediction(actions(0.4), cube(0.4)), ("objects", "cube lies outside of what was shown")),
    (prediction(actions(0.12), cube(0.12, confidence=0.6)), ("objects", "The pose of cube is not certain")),
    (
        prediction(actions(0.12), cube(0.12), instruction="fetch it"),
        ("instruction", "No demonstration has this instruction"),
    ),
    (prediction(actions(0.12)[:2], cube(0.12)), ("actions", "2 actions")),
    (
        prediction(actions(0.12, is_open=(True, True, False)), cube(0.12)),
        ("actions", "Action 2 has the gripper the other way"),
    ),
    (
        prediction(actions(0.12), cube(0.12), demonstration_ids=("0", "1", "2", "gone")),
        ("demonstrations", "Demonstrations were deleted since"),
    ),
    (
        prediction([], cube(0.12), status="parse_error", actions=None, error="the reply has 0 lists"),
        ("reply", "The reply is not a list of valid actions"),
    ),
]


@pytest.mark.parametrize(("record", "expected"), FAULTS, ids=[title for _, (_, title) in FAULTS])
def test_each_fault_is_found_alone(record, expected):
    assert found(record) == [expected]


def test_actions_beside_the_object_are_found():
    beside = explained(prediction(actions(0.12, dx_m=0.05), cube(0.12)))
    assert [finding.title for finding in beside.findings] == [f"Action {k} goes elsewhere" for k in (1, 2, 3)]
    assert beside.findings[0].text.startswith("5.0 cm from where the demonstrations go, seen from cube")


def test_without_its_demonstrations_only_their_loss_is_told():
    assert found(prediction(actions(0.12), cube(0.12)), []) == [("demonstrations", "Demonstrations were deleted since")]


def test_a_step_of_a_closed_loop_is_not_taken_for_the_whole():
    assert found(prediction(actions(0.12)[1:2], cube(0.12), step=1)) == []
