"""Objects that hands take by the nearest of their sides, and those of which the side matters."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.plans.symmetry import folded, shown_symmetries
from roboprompt_client.types.quaternions import yaw_rad

from ..recordings import arrival_s, pick_and_place, resting
from ..scenes import pose, rotated
from .taught import recording

UP_M = np.array([0, 0, 0.12])


def nearest_deg(yaw_deg, turn_deg, home_deg=0.0):
    return (yaw_deg - home_deg + turn_deg / 2) % turn_deg - turn_deg / 2 + home_deg


def taken(yaw_deg, hand_deg, released_deg, random, aside_m=0.0, plate_deg=None):
    """A cube with that yaw, taken and let go of by hands with these; `aside_m` from its middle along its own x axis."""
    plate_deg = float(random.uniform(-50, 50)) if plate_deg is None else plate_deg
    cube_m, plate_m = (
        random.uniform([0.2, -0.3, 0.02], [0.4, -0.05, 0.02]),
        random.uniform([0.2, 0.1, 0.0], [0.4, 0.3, 0]),
    )
    placed_m = np.add(plate_m, [0, 0, 0.05])
    held_m = cube_m + rotated(0, 0, yaw_deg).apply([aside_m, 0, 0])
    motion = pick_and_place(held_m, placed_m, move=resting, start_m=(0.3, 0, 0.5))
    starts_s, ends_s = arrival_s(motion, held_m + UP_M, 2), arrival_s(motion, placed_m + UP_M, 0)
    turns = ((0.0, hand_deg), (starts_s + 0.4, hand_deg), (ends_s, released_deg), (motion.duration_s, released_deg))
    objects = pose("cube", cube_m, yaw_deg), pose("plate", plate_m, plate_deg)
    return recording(replace(motion, turns=turns), objects, instruction="put the cube on the plate")


def group(hand_deg, released_deg=lambda yaw_deg, hand_deg: 0.0, number=10, most_deg=180.0, aside_m=0.0, seed=0):
    random = np.random.default_rng(seed)
    yaws_deg = random.uniform(-most_deg, most_deg, number).tolist()
    hands_deg = [hand_deg(yaw_deg) for yaw_deg in yaws_deg]
    return [
        taken(yaw, hand, released_deg(yaw, hand), random, aside_m)
        for yaw, hand in zip(yaws_deg, hands_deg, strict=True)
    ]


CUBE = lambda yaw_deg: nearest_deg(yaw_deg, 90)  # noqa: E731
BRICK = lambda yaw_deg: nearest_deg(yaw_deg, 180)  # noqa: E731


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("hand_deg", "how", "turn_deg"),
    [
        (CUBE, {}, 90),
        (lambda yaw_deg: nearest_deg(yaw_deg, 90, home_deg=35), {}, 90),  # the arm stands elsewhere
        (CUBE, {"released_deg": lambda yaw_deg, hand_deg: hand_deg}, 90),  # stays as it was taken
        (BRICK, {}, 180),
        (CUBE, {"aside_m": 0.05}, None),  # a handle
        (BRICK, {"aside_m": 0.05}, None),
        (CUBE, {"released_deg": lambda yaw_deg, hand_deg: hand_deg - yaw_deg}, None),  # its front ends at a place
        (BRICK, {"released_deg": lambda yaw_deg, hand_deg: hand_deg - yaw_deg}, None),
        (lambda yaw_deg: yaw_deg, {}, None),  # the hand follows it round
        (lambda yaw_deg: yaw_deg + 90 * (round(yaw_deg) % 4), {}, None),  # any side
        (lambda yaw_deg: 0.0, {}, None),  # it is round
        (CUBE, {"number": 4}, None),
    ],
)
def test_a_symmetry_is_shown_only_where_nothing_depends_on_the_side(hand_deg, how, turn_deg, seed):
    recordings = group(hand_deg, seed=seed, **how)
    symmetries = shown_symmetries(recordings, {})
    assert {name: item.turn_deg for name, item in symmetries.items()} == ({"cube": turn_deg} if turn_deg else {})
    for given, turned in zip(recordings, folded(recordings, symmetries), strict=True):
        cube, hand = (
            turned.demonstration.object("cube"),
            Rotation.from_quat(given.motion.trajectory.quaternions_xyzw[0]),
        )
        if turn_deg:  # as the first hand takes it
            relative = Rotation.from_quat(cube.quaternion_xyzw).inv() * hand
            assert np.degrees((symmetries["cube"].grasp.inv() * relative).magnitude()) < 1e-6
        else:
            assert turned is given


@pytest.mark.parametrize(("slips", "shown"), [(1, True), (2, False)])
def test_one_of_ten_may_slip(slips, shown):
    """The side may decide between two ways, but not where one recording has another."""
    recordings = group(CUBE)
    for k in range(slips):
        trajectory, again = recordings[k].motion.trajectory, recordings[k].motion.switches[0].frame + 4
        is_open = trajectory.gripper_open.copy()
        is_open[again : again + 8] = True
        motion = replace(recordings[k].motion, trajectory=replace(trajectory, gripper_open=is_open))
        recordings[k] = replace(recordings[k], motion=motion)
    assert bool(shown_symmetries(recordings, {})) == shown


def test_a_setting_has_the_last_word():
    assert not shown_symmetries(group(CUBE), {"cube": 360.0})


def test_a_scene_is_folded_to_what_hands_reach():
    (symmetry,) = shown_symmetries(group(lambda yaw_deg: nearest_deg(yaw_deg, 90, home_deg=35)), {}).values()
    for yaw_deg in range(-180, 180, 17):
        found = symmetry.folded(pose("cube", (0, 0, 0), float(yaw_deg)))
        hand_deg = np.degrees(yaw_rad((Rotation.from_quat(found.quaternion_xyzw) * symmetry.grasp).as_quat()))
        assert abs(nearest_deg(hand_deg - yaw_deg, 90)) < 1e-6
        assert abs(hand_deg - 35) < 60
