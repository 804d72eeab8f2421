from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.groups import by_plan, shown_together
from app.pipeline.keyframes import Motion
from app.pipeline.plans import agreeing, aligned_by_plan
from app.pipeline.plans.rows import plan_rows

from ..recordings import flowing, pick_and_place
from ..scenes import pose
from .taught import picked, picks, recording, scene, slipped


def grasps(demonstration):
    return [k for k, action in enumerate(demonstration.actions) if not action.gripper_open]


@pytest.mark.parametrize("first_seed", [0])
def test_demonstrations_of_one_plan_get_equally_many_rows(first_seed):
    """Whatever their rate, speed, tremor and start."""
    recordings = [picked(first_seed + k) for k in range(8)]
    aligned = aligned_by_plan(recordings)
    assert len({(d.plan, len(d.actions)) for d in aligned}) == 1
    assert len({tuple(grasps(d)) for d in aligned}) == 1
    grasp, release = grasps(aligned[0])[0], grasps(aligned[0])[-1] + 1
    for item, demonstration in zip(recordings, aligned, strict=True):
        for k, place_m in (
            (grasp, demonstration.objects[0].position_m),
            (release, demonstration.objects[1].position_m),
        ):
            nearest_m = np.linalg.norm(item.motion.trajectory.positions_m - place_m, axis=1).min()
            assert np.linalg.norm(demonstration.actions[k].position_m - place_m) < nearest_m + 0.005


def test_another_sequence_of_grasps_is_another_plan():
    *alike, other = aligned_by_plan([*(picked(k) for k in range(4)), slipped(9)])
    assert len({d.plan for d in alike}) == 1
    assert other.plan != alike[0].plan
    assert [action.gripper_open for action in other.actions].count(False) > len(grasps(alike[0])) - 2
    assert [len(group) for group in by_plan((*alike, other))] == [4, 1]


def test_a_plan_as_rare_as_a_slip_is_not_shown():
    aligned = aligned_by_plan([*(picked(k) for k in range(4)), slipped(9)])
    assert shown_together(aligned) == aligned[:4]
    both = aligned_by_plan([*(picked(k) for k in range(2)), slipped(8), slipped(9)])
    assert shown_together(both) == both


@pytest.mark.parametrize("number", [2, 6])
def test_two_ways_of_doing_a_thing_are_two_plans(number):
    """The cube is grasped on its left or on its right, 8 cm apart."""
    recordings = []
    for k in range(2 * number):
        side_m = [0.0, 0.04 * (-1) ** k, 0.0]
        motion, objects = picks(50 + k)
        shifted = tuple((time_s, tuple(np.add(at_m, side_m))) for time_s, at_m in motion.knots)
        recordings.append(recording(replace(motion, knots=shifted), objects))
    aligned = aligned_by_plan(recordings)
    plans = [d.plan for d in aligned]
    if number > 2:  # two and two may lie apart by chance: then they are one plan, but not averaged
        assert set(plans[0::2]).isdisjoint(plans[1::2])
    for demonstration, recorded in zip(agreeing(aligned), aligned, strict=True):
        k = grasps(recorded)[0]
        assert np.linalg.norm(demonstration.actions[k].position_m - recorded.actions[k].position_m) < 0.01


def carried(seed, through_m):
    """The cube is grasped, carried through places and let go at the plate.

    Args:
        through_m: of the scene's places of cube and plate.
    """
    cube, plate = scene(np.random.default_rng(seed))
    through = through_m(cube.position_m, plate.position_m)
    up_m = np.add(plate.position_m, [0, 0, 0.15])
    motion = flowing([(0.1, 0.0, 1.1), cube.position_m, *through, plate.position_m, up_m])
    return recording(replace(motion, switches=(motion.knots[1][0], motion.knots[-2][0])), (cube, plate))


def test_rows_are_the_same_stage_of_a_task_in_every_demonstration():
    """All pass one gate, which is the first keyframe of some, and of others the second, third or fourth."""
    gate_m = (0.1, 0.0, 1.0)
    before_m = [(-0.1, 0.3, 0.9), (0.3, 0.3, 0.95), (0.3, -0.2, 0.95)]
    recordings = [carried(800 + k, lambda *_, number=k % 4: [*before_m[:number], gate_m]) for k in range(10)]
    (group,) = by_plan(aligned_by_plan(recordings))
    assert min(np.linalg.norm(row.positions_m - gate_m, axis=1).max() for row in plan_rows(group)) < 0.02


def both_moved(seed, *, cube_first):
    """The hand closes on the cube and on the cup, in either order, and lets go of each at the plate."""
    random = np.random.default_rng(seed)
    cube_m, cup_m = np.array([0.0, -0.25, 0.79]), np.array([0.05, 0.25, 0.79])
    cube_m, cup_m = (np.add(place_m, [*random.uniform(-0.04, 0.04, 2), 0]) for place_m in (cube_m, cup_m))
    plate_m = np.array([0.35, 0.0, 0.79])
    first_m, second_m = (cube_m, cup_m) if cube_first else (cup_m, cube_m)
    down_m = plate_m + np.array([0, 0, 0.03])
    one, two = (pick_and_place(at_m, down_m, start_m=(0.1, 0.0, 1.1)) for at_m in (first_m, second_m))
    later_s = one.knots[-1][0] + 1.0
    knots = (*one.knots, *((time_s + later_s, at_m) for time_s, at_m in two.knots))
    switches = (*one.switches, *(time_s + later_s for time_s in two.switches))
    objects = [pose("red cube", cube_m), pose("cup", cup_m), pose("plate", plate_m)]
    instruction = "put the red cube and the cup on the plate"
    return recording(replace(one, knots=knots, switches=switches), objects, instruction=instruction)


def test_the_order_in_which_objects_are_grasped_is_part_of_a_plan():
    recordings = [both_moved(seed, cube_first=seed != 2) for seed in range(4)]
    assert [one.grasped for one in recordings] == [(0, 1), (0, 1), (1, 0), (0, 1)]
    assert [len(group) for group in by_plan(aligned_by_plan(recordings))] == [3, 1]


def test_a_recording_that_ends_with_its_release_has_the_plan_of_those_that_go_on():
    recordings = [picked(600 + k) for k in range(4)]
    longer, frames = recordings[0], recordings[0].motion.phases[-1].first + 1
    recorded = longer.motion.trajectory
    arrays = {name: array[:frames] for name, array in vars(recorded).items() if isinstance(array, np.ndarray)}
    shorter = replace(longer, motion=Motion.of(replace(recorded, **arrays)))
    assert shorter.signature != longer.signature
    aligned = aligned_by_plan([shorter, *recordings[1:]])
    assert len({(d.plan, len(d.actions)) for d in aligned}) == 1
    np.testing.assert_allclose(aligned[0].actions[-1].position_m, shorter.motion.trajectory.positions_m[-1])
    assert len({d.plan for d in aligned_by_plan([shorter, *recordings[1:2]])}) == 2  # neither is the usual end


def presses(seed):
    """The closed hand presses a cube and then a plate, some with a detour on the way."""
    random = np.random.default_rng(seed)
    objects = scene(random)
    stops_m = [np.array([0.1, 0.0, 1.1])]
    for seen in objects:
        above_m = np.add(seen.position_m, [0, 0, 0.1])
        for stop_m in (above_m + random.uniform(-0.03, (0.03, 0.03, 0.06)), seen.position_m, above_m):
            if random.uniform() < 0.4:
                stops_m.append((stops_m[-1] + stop_m) / 2 + random.uniform(-0.05, 0.05, 3))
            stops_m.append(stop_m)
    motion = flowing(stops_m, speed_m_s=random.uniform(0.15, 0.25), starts_open=False, blend_s=0.0)
    return recording(motion, objects, instruction="press the red cube, then the plate")


@pytest.mark.parametrize("first_seed", [40])
def test_presses_of_a_hand_that_never_switches_keep_their_places(first_seed):
    for shown in agreeing(aligned_by_plan([presses(first_seed + k) for k in range(10)])):
        for pressed in shown.objects:
            assert min(np.linalg.norm(a.position_m - pressed.position_m) for a in shown.actions) < 0.01
