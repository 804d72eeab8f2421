"""The method `voxposer`: asked with no demonstrations, answered with a program, recorded like any prediction."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from app.llm.base import ModelTimeoutError
from app.perception.base import ObjectQuery
from app.pipeline.errors import ObjectSetError
from app.services.limits import UnparsableReplyError, UnsafeReplyError
from app.services.predict.options import OF_ROWS, PredictOptions
from app.services.predict.question import PredictRequest
from app.store import predictions
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion_limits import Pose
from tests.services.test_upload_episode import respond, upload

CUBE_M = (0.203, 0.104, 0.801)
START = Pose((0.0, 0.0, 1.2), (1.0, 0.0, 0.0, 0.0))
VOXPOSER = PredictOptions(method="voxposer")
REQUEST = PredictRequest(
    "pick", "pick up the cube", (ObjectQuery("cube", CUBE_M),), end_effector=START, options=VOXPOSER
)
GO = "target = empty_affordance_map()\nset_voxels(target, detect('cube'))\nmove(target)\n"


def ask(services, request=REQUEST):
    return asyncio.run(services.predict_actions(request))


@pytest.fixture
def services(scripted):
    """Services with a task that has no demonstration."""

    def wire(*replies, **options):
        services = scripted(*replies, **options)
        services.configure_task("pick", {"workspace": {"preset": "rlbench"}})
        return services

    return wire


def recorded(store):
    with store.read() as connection:
        return predictions.list_page(connection).items


def test_a_program_becomes_actions_and_is_recorded(store, services):
    asked = []
    prediction = ask(services(f"Here it is:\n```python\n{GO}```", asked=asked))
    last = prediction.actions[-1].action
    assert np.abs(last.position_m - CUBE_M).max() <= 0.005 + 1e-9
    assert last.gripper_open
    assert asked[0].prompt.user.endswith('# objects: "cube"\n# task: pick up the cube\n')
    (record,) = recorded(store)
    assert (record.id, record.status, record.representation) == (prediction.id, "ok", "voxposer")
    assert (record.demonstration_ids, record.step) == ((), None)
    assert len(record.actions) == len(prediction.actions)
    assert GO in record.reply_text
    assert "empty_affordance_map" in record.prompt_user
    assert "shifted_along" in record.prompt_system
    assert [finding["code"] for finding in record.findings] == ["undemonstrated-actions", "assumed-size"]
    assert {"llm", "program"} <= set(record.timings_ms)


def test_the_objects_are_those_of_the_demonstrations_where_there_are_any(services):
    wired = services(GO)
    wired.upload_episode(upload("cube", "plate"), respond)
    with pytest.raises(ObjectSetError, match="missing: plate"):
        ask(wired)


@pytest.mark.parametrize(
    ("reply", "why"),
    [
        ("", "the program is empty"),
        ("[[50, 50, 20, 0, 36, 36, 1]]", "the program has no move"),
        ("for a in range(999):\n    for b in range(999):\n        c = a\n", "takes more than 100000 steps"),
        ("while True:\n    pass\n", "line 1: While is not allowed"),
        (GO.replace("cube", "mug"), "line 2: detect: there is no object 'mug'"),
        ("target = empty_affordance_map()\nmove(target)\n", "no voxel of the affordance map is above 0"),
        ("```\nx = 1\n```\n```\nx = 1\n```", "the reply is not one program"),
        ("x = 1 # " + "word " * 3000, "the program was cut off"),
    ],
)
def test_a_program_that_fails_is_recorded_without_actions(store, services, reply, why):
    with pytest.raises(UnparsableReplyError, match=why) as caught:
        ask(services(reply))
    (record,) = recorded(store)
    assert record.id == caught.value.prediction_id
    assert (record.status, record.actions) == ("parse_error", None)
    assert caught.value.reply_text == record.reply_text
    assert reply.startswith(record.reply_text)


def test_more_actions_than_asked_for_are_no_answer(services):
    with pytest.raises(UnparsableReplyError, match="max_actions = 1"):
        ask(services(GO * 2), replace(REQUEST, options=PredictOptions(method="voxposer", max_actions=1)))


def test_actions_are_held_to_the_bounds_of_motion(store, services):
    wired = services(GO)
    box = {"min": [0.1, 0.0, 0.7], "max": [0.3, 0.2, 0.9]}
    wired.configure_task("pick", {"motion_limits": {"keep_out": [box]}})
    with pytest.raises(UnsafeReplyError):
        ask(wired)
    (record,) = recorded(store)
    assert (record.status, record.actions) == ("unsafe_action", None)


def test_a_model_that_does_not_answer_is_recorded(store, services):
    with pytest.raises(ModelTimeoutError):
        ask(services(ModelTimeoutError("no answer within 1 s")))
    assert recorded(store)[0].status == "model_error"


def test_what_the_plan_leaves_out_is_said(services):
    program = """
target = empty_affordance_map()
set_voxels(target, detect("cube"))
wall = empty_avoidance_map()
wall[:, :, 35:45] = 1
slow = empty_velocity_map()
slow[:] = 0.2
move(target, wall, velocity=slow)
"""
    request = replace(REQUEST, options=PredictOptions(method="voxposer", max_actions=100))
    found = {finding.code: finding.severity for finding in ask(services(program), request).findings}
    of_plan = {"assumed-size": "info", "planner-stuck": "warning", "velocity-not-sent": "info"}
    assert found == {"undemonstrated-actions": "danger", **of_plan}


def test_the_end_effector_is_needed(services):
    with pytest.raises(InvalidInputError, match="end_effector: is missing"):
        ask(services(GO), replace(REQUEST, end_effector=None))


OTHER_VALUES = {
    "demonstrations_from": "similar",
    "num_demonstrations": 3,
    "selection": "recent",
    "num_samples": 2,
    "permute_demonstrations": True,
    "episode_ids": ("a",),
    "representation": "absolute",
    "prompt_format": "paper",
    "system_prompt": "a",
    "closed_loop": True,
    "after": "a",
    "unfamiliar": "allow",
    "unsupported": "allow",
}


@pytest.mark.parametrize("name", OF_ROWS)
def test_options_of_the_other_method_are_refused(name):
    with pytest.raises(InvalidInputError, match="has no meaning with the method voxposer") as caught:
        replace(REQUEST, options=PredictOptions(method="voxposer", **{name: OTHER_VALUES[name]}))
    assert caught.value.field == name
