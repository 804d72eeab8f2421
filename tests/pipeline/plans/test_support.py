from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Query
from app.pipeline.errors import UnsupportedActionError
from app.pipeline.groups import by_plan
from app.pipeline.plans import agreeing, aligned_by_plan
from app.pipeline.plans.support import Support, SupportGuard
from app.pipeline.representation.object_frame import ObjectFrameCodec
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction
from tests.pipeline.asking import grammar_of

from ..gbnf import matches
from ..recordings import flowing, resting
from ..scenes import WORKSPACE, action, demonstration, pose
from .taught import INSTRUCTION, picked


@pytest.fixture(scope="module", params=[flowing, resting], ids=["flowing", "resting"])
def recorded(request):
    return aligned_by_plan([picked(400 + k, move=request.param) for k in range(6)])


def check(demonstrations, actions, objects, instruction=INSTRUCTION, start=None):
    """Let a whole reply pass."""
    plans = Support.of(by_plan(demonstrations)).placed(Query(instruction, tuple(objects), start=start))
    guard = SupportGuard(plans)
    for one in actions:
        guard.check(one)
    guard.finish()


def refused(demonstrations, actions, objects, **more):
    with pytest.raises(UnsupportedActionError) as caught:
        check(demonstrations, actions, objects, **more)
    return caught.value


def changed(actions, k, **values):
    return [replace(item, **values) if place == k else item for place, item in enumerate(actions)]


def test_what_was_demonstrated_is_supported(recorded):
    for own, shown in zip(recorded, agreeing(recorded), strict=True):
        check(recorded, own.actions, own.objects, start=own.start)
        check(recorded, shown.actions, own.objects, start=own.start)


def test_it_is_supported_in_an_unseen_scene(recorded):
    """Where the objects are elsewhere, the rows that follow them are expected there."""
    shift_m = np.array([0.05, -0.07, 0.0])
    own = recorded[0]
    moved = [replace(item, position_m=item.position_m + shift_m) for item in own.objects]
    plans = Support.of(by_plan(recorded)).placed(Query(INSTRUCTION, moved, start=own.start))
    guard = SupportGuard(plans)
    for row, one in zip(plans[0], own.actions, strict=True):
        follows = shift_m if row.anchor.object_name else 0
        guard.check(replace(one, position_m=one.position_m + follows))
    guard.finish()


@pytest.mark.parametrize("place", [0, 1, -1])
def test_an_action_elsewhere_is_refused(recorded, place):
    own = recorded[0]
    k = place % len(own.actions)
    aside = np.add(own.actions[k].position_m, [0.0, 0.1, 0.0])
    error = refused(recorded, changed(own.actions, k, position_m=aside), own.objects, start=own.start)
    assert error.field == f"actions[{k}]"
    assert "cm from where demonstrations go" in str(error)
    assert "expected: within" in str(error)
    assert "seen from" in str(error)


def test_an_action_turned_otherwise_is_refused(recorded):
    own = recorded[0]
    turned = (Rotation.from_euler("x", 60, degrees=True) * Rotation.from_quat(own.actions[1].quaternion_xyzw)).as_quat()
    error = refused(recorded, changed(own.actions, 1, quaternion_xyzw=turned), own.objects, start=own.start)
    assert error.field == "actions[1]"
    assert "turned by 60" in str(error)


def test_a_gripper_the_other_way_is_refused(recorded):
    own = recorded[0]
    k = next(place for place, item in enumerate(own.actions) if not item.gripper_open)
    error = refused(recorded, changed(own.actions, k, gripper_open=True), own.objects, start=own.start)
    assert error.field == f"actions[{k}]"
    assert "has the gripper open" in str(error)


def test_a_missing_row_is_refused(recorded):
    own = recorded[0]
    number = len(own.actions)
    error = refused(recorded, own.actions[:-1], own.objects, start=own.start)
    assert error.field == f"actions[{number - 1}]"
    assert f"expected: {number} actions" in str(error)


def test_an_additional_row_is_refused(recorded):
    own = recorded[0]
    number = len(own.actions)
    error = refused(recorded, [*own.actions, own.actions[-1]], own.objects, start=own.start)
    assert error.field == f"actions[{number}]"
    assert f"expected: at most {number} actions" in str(error)


PLACE_M, ASIDE_M = (0.1, 0.2, 0.8), np.array([0.0, 0.15, 0.0])
SMALL = [pose("red cube", PLACE_M), pose("plate", (0.4, -0.2, 0.8))]


def two_plans():
    """From the left in two actions, or from the right in two others."""
    left = [action(PLACE_M + ASIDE_M), action(PLACE_M + ASIDE_M / 2, gripper_open=False)]
    right = [action(PLACE_M - ASIDE_M), action(PLACE_M - ASIDE_M / 2, gripper_open=False)]
    ways = [replace(demonstration(INSTRUCTION, SMALL, ways), plan=k) for k, ways in enumerate((left, right))]
    return ways, left, right


def test_two_plans_do_not_mix():
    ways, left, right = two_plans()
    check(ways, left, SMALL)
    check(ways, right, SMALL)
    error = refused(ways, [left[0], right[1]], SMALL)
    assert error.field == "actions[1]"
    codec = ObjectFrameCodec.fit(ways, WORKSPACE, with_instruction=True)
    grammar = grammar_of(codec, INSTRUCTION)
    first, second = (codec.actions_text(way).split("; ") for way in ways)
    assert matches(grammar, f" {'; '.join(first)}\n")
    assert matches(grammar, f" {'; '.join(second)}\n")
    assert not matches(grammar, f" {first[0]}; {second[1]}\n")


def test_the_rows_of_one_clause_of_several_are_unknown():
    _, left, _ = two_plans()
    both = replace(demonstration(f"{INSTRUCTION}, then {INSTRUCTION}", SMALL, [*left, *left]), plan=1)
    assert Support.of(by_plan([both])).placed(Query(INSTRUCTION, SMALL)) is None


def test_plans_of_one_clause_support_several():
    ways, left, right = two_plans()
    placed = Support.of(by_plan(ways)).placed(Query(f"{INSTRUCTION}, then {INSTRUCTION}", SMALL))
    assert [len(plan) for plan in placed] == [4] * 4
    check(ways, [*left, *right], SMALL, f"{INSTRUCTION}, then {INSTRUCTION}")
    error = refused(ways, [left[0], right[1], *left], SMALL, instruction=f"{INSTRUCTION}, then {INSTRUCTION}")
    assert error.field == "actions[1]"


def test_clauses_whose_plans_combine_in_too_many_ways_are_refused():
    ways, *_ = two_plans()
    with pytest.raises(InvalidInputError, match="7 clauses, whose demonstrated plans combine in 128 ways"):
        Support.of(by_plan(ways)).placed(Query(", then ".join([INSTRUCTION] * 7), SMALL))


def test_demonstrations_with_as_many_clauses_support_an_instruction():
    (way, _), left, _ = two_plans()
    both = replace(demonstration(f"{INSTRUCTION}, then {INSTRUCTION}", SMALL, [*left, *left]), plan=1)
    support = Support.of(by_plan([way, both]))
    placed = [
        support.placed(Query(", then ".join([text] * n), SMALL)) for text in ("lift it", INSTRUCTION) for n in (1, 2)
    ]
    assert [[len(plan) for plan in plans] for plans in placed] == [[2], [4], [2], [4]]


def test_a_row_tells_how_far_demonstrations_scatter():
    offsets_m = np.linspace(-0.01, 0.01, 5)
    shown = [
        replace(demonstration(INSTRUCTION, SMALL, [action(np.add(PLACE_M, [dx_m, 0, 0.1]))]), plan=0)
        for dx_m in offsets_m
    ]
    ((row,),) = Support.of(by_plan(shown)).placed(Query(INSTRUCTION, SMALL))
    assert row.anchor.object_name == "red cube"
    (tolerance_m, _), (reach_m, _) = row.demonstrated.tolerance, row.demonstrated.reach
    assert 0.005 <= tolerance_m <= 0.01 < reach_m == pytest.approx(0.04)
    far = EndEffectorAction(np.add(PLACE_M, [0.041, 0, 0.1]), row.action.quaternion_xyzw, gripper_open=True)
    near = replace(far, position_m=np.add(PLACE_M, [0.039, 0, 0.1]))
    assert (row.supports(near), row.supports(far)) == (True, False)
