"""Plans are chosen by what of the scenes parts them, and nothing is chosen by chance."""

import time
from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.plans.by_scene import ways_of
from app.pipeline.plans.choice import MAX_WARMED, PlanChooser
from roboprompt_client.errors import InvalidInputError

from ..scenes import action, demonstration, pose

INSTRUCTION = "put the nut on the peg"
PEG_M = (0.3, 0.1, 0.8)
UP_M = np.array([0.0, 0.0, 0.1])


def placed(yaw_deg, handle_deg, *, plan, number, nut_m=(0.0, -0.2, 0.8)):
    """The nut is grasped at its handle and put down with the handle in another direction."""
    nut, peg = pose("nut", nut_m, float(yaw_deg)), pose("peg", PEG_M, 0.0)

    def at_handle(center_m, deg):
        return np.array(center_m) + 0.06 * np.array([np.cos(np.radians(deg)), np.sin(np.radians(deg)), 0.0])

    held_m, down_m = at_handle(nut_m, yaw_deg), at_handle(PEG_M, handle_deg)
    actions = [
        action(held_m + UP_M, (180, 0, yaw_deg)),
        action(held_m, (180, 0, yaw_deg), gripper_open=False),
        action(down_m + UP_M, (180, 0, handle_deg), gripper_open=False),
        action(down_m, (180, 0, handle_deg)),
    ]
    return replace(demonstration(INSTRUCTION, (nut, peg), actions), plan=plan, id=f"episode-{number}")


def handle_of(yaw_deg):
    return min((90, 180, 270), key=lambda handle: abs((yaw_deg - handle + 180) % 360 - 180))


def taught(yaws_deg):
    handles = [handle_of(yaw_deg) for yaw_deg in yaws_deg]
    plans = {handle: plan for plan, handle in enumerate(dict.fromkeys(handles))}
    return [
        placed(yaw_deg, handle, plan=plans[handle], number=number)
        for number, (yaw_deg, handle) in enumerate(zip(yaws_deg, handles, strict=True))
    ]


SHOWN_DEG = (-23, 10, -123, 41, -164, -5, -54, 168, 172, 157)


def scene(yaw_deg):
    return pose("nut", (0.0, -0.2, 0.8), float(yaw_deg)), pose("peg", PEG_M, 0.0)


@pytest.mark.parametrize("yaw_deg", [-49, -63, 65, 145, 122, 176, 15, -106, 134, 55])
def test_a_prompt_shows_the_plan_of_the_nearest_yaw(yaw_deg):
    chosen = PlanChooser(taught(SHOWN_DEG))(scene(yaw_deg))
    off_deg = [abs((yaw_deg - other + 180) % 360 - 180) for other in SHOWN_DEG]
    nearest = SHOWN_DEG[int(np.argmin(off_deg))]
    expected = {f"episode-{k}" for k, other in enumerate(SHOWN_DEG) if handle_of(other) == handle_of(nearest)}
    assert {shown.id for shown in chosen.shown} == expected
    (finding, *_) = chosen.findings
    assert finding.code == "plan-of-this-scene"
    assert finding.where == "objects[nut]"
    assert f"the yaw of nut is {yaw_deg} degrees" in finding.message


def test_a_scene_without_the_rotation_that_decides_is_refused():
    nut, peg = scene(10)
    with pytest.raises(InvalidInputError, match=r"objects\[nut\].quaternion_xyzw: is missing"):
        PlanChooser(taught(SHOWN_DEG))((replace(nut, quaternion_xyzw=None), peg))


def codes(chosen):
    return {finding.code: finding.severity for finding in chosen.findings}


def test_a_scene_between_two_plans_is_a_warning_and_one_far_from_all_is_a_danger():
    chooser = PlanChooser(taught([-80, -90, -100, -95, 85, 90, 95, 100]))
    assert codes(chooser(scene(90)))["plan-of-this-scene"] == "info"
    assert codes(chooser(scene(0)))["scene-beyond-plans"] == "danger"
    near = PlanChooser(taught([-80, -70, -60, -50, -40, 20, 30, 40, 50, 60]))
    assert codes(near(scene(-9)))["scene-between-plans"] == "warning"


def test_ways_that_act_alike_are_one():
    """They were recorded with other poses on the way."""
    group = taught(SHOWN_DEG)
    others = [replace(d, plan=7, actions=(action(UP_M + PEG_M), *d.actions)) for d in group[8:]]
    again = [*group[:8], *others]
    assert ways_of(again).tolist() == ways_of(group).tolist()


def test_one_plan_shows_all_in_every_scene_and_says_nothing():
    chosen = PlanChooser(taught([80, 90, 100, 110]))(scene(0))
    assert len(chosen.shown) == 4
    assert chosen.findings == ()


def test_plans_of_one_demonstration_each_show_one_and_name_the_others():
    group = [placed(yaw, 90 * k, plan=k, number=k) for k, yaw in enumerate((0, 5, 10, 15))]
    chosen = PlanChooser(group)(scene(5))
    assert len(chosen.shown) == 1
    assert codes(chosen) == {"few-demonstrations": "info", "left-out": "info", "no-common-plan": "warning"}


def test_prompts_that_are_read_beforehand_are_those_of_the_most_usual_plans():
    chooser = PlanChooser(taught(SHOWN_DEG))
    likely = [tuple(shown.id for shown in choice.shown) for choice in chooser.likely()]
    assert len(likely) == 3 <= MAX_WARMED
    assert sorted(map(len, likely), reverse=True) == list(map(len, likely))
    assert tuple(shown.id for shown in chooser(scene(170)).shown) in likely


def test_what_plans_depend_on_is_found_once_and_not_for_each_scene():
    started_s = time.process_time()
    chooser = PlanChooser(taught(np.linspace(-179, 180, 100)))
    chooser(scene(0))
    compared_s = time.process_time() - started_s
    for yaw_deg in range(100):
        chooser(scene(yaw_deg))
    chosen_s = (time.process_time() - started_s - compared_s) / 100
    assert chosen_s < compared_s / 100
