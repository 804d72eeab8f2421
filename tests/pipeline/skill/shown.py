"""Recordings of a hand that puts a cup on a coaster, in scenes drawn from a seed."""

from dataclasses import replace

import numpy as np

from app.pipeline.episode import Demonstration, Query
from app.pipeline.keyframes import Motion
from app.pipeline.skill import turns
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose
from roboprompt_client.types.trajectory import Trajectory

WORDS = "put the cup on the coaster"
DOWN = np.array([1.0, 0.0, 0.0, 0.0])
HOME_M = np.array([0.2, 0.0, 1.1])
UP_M = np.array([0.0, 0.0, 1.0])
SPEED_M_S, RATE_HZ, REST_FRAMES = 0.25, 20.0, 6


def home(position_m=HOME_M, quaternion_xyzw=DOWN):
    return EndEffectorAction(position_m, quaternion_xyzw, True)


def posed(name, position_m, yaw_rad=0.0):
    return ObjectPose(name, position_m, turns.about_z(yaw_rad))


def drawn(random):
    """A cup and a coaster that stand apart on a table, at any yaw."""
    while True:
        places = random.uniform((0.05, -0.3), (0.45, 0.3), (2, 2))
        if np.linalg.norm(places[0] - places[1]) > 0.15:
            cup, coaster = np.array([*places[0], 0.82]), np.array([*places[1], 0.8])
            return posed("cup", cup, random.uniform(-1, 1)), posed("coaster", coaster, random.uniform(-1, 1))


def travelled(stops):
    """The trajectory through stops (place, rotation, open); the hand rests at each, and the gripper acts there."""
    places, hands, grips, speeds = [], [], [], []
    for k, (place, hand, is_open) in enumerate(stops):
        before, turned, was_open = stops[max(k - 1, 0)]
        count = max(2, int(np.linalg.norm(place - before) / SPEED_M_S * RATE_HZ)) if k else 0
        turning = turns.log(turns.product(turns.inverse(turned), hand))
        for share in np.arange(1, count + 1) / max(count, 1):
            smooth = share**3 * (10 - 15 * share + 6 * share**2)  # minimum jerk
            places.append(before + smooth * (place - before))
            hands.append(turns.product(turned, turns.exp(smooth * turning)))
            speeds.append(18 * share**2 * (1 - share) ** 2 + (share < 1) * 0.15)
            grips.append(was_open)
        places += [place] * REST_FRAMES
        hands += [hand] * REST_FRAMES
        speeds += [0.0] * REST_FRAMES
        grips += [was_open] * (REST_FRAMES // 2) + [is_open] * (REST_FRAMES // 2)
    joints = np.outer(speeds, np.ones(7) / np.sqrt(7))
    return Trajectory(joints, np.array(places), np.array(hands), np.array(grips, dtype=bool))


def stops_of(cup, coaster, start=HOME_M):
    """Above the cup, at it, up, above the coaster, at it, up; the hand turns with the cup, then with the coaster."""
    taking, putting = (turns.product(pose.quaternion_xyzw, DOWN) for pose in (cup, coaster))
    at, to = cup.position_m, coaster.position_m
    return [
        (np.array(start), DOWN, True), (at + 0.12 * UP_M, taking, True), (at + 0.01 * UP_M, taking, False),
        (at + 0.2 * UP_M, taking, False), (to + 0.2 * UP_M, putting, False), (to + 0.06 * UP_M, putting, True),
        (to + 0.2 * UP_M, putting, True),
    ]  # fmt: skip


def recording(objects, stops, number=0, words=WORDS, symmetry=None):
    demonstration = Demonstration(words, tuple(objects), (), id=str(number))
    return Recording.of(demonstration, Motion.of(travelled(stops), RATE_HZ), symmetry)


def recordings(count=6, seed=1, change=None, symmetry=None):
    """Recordings in scenes of a seed.

    Args:
        change: from number and (objects, stops) to those that are recorded.
    """
    random, found = np.random.default_rng(seed), []
    for number in range(count):
        objects = drawn(random)
        told, stops = objects, stops_of(*objects)
        if change is not None:
            told, stops = change(number, told, stops)
        found.append(recording(told, stops, number, symmetry=symmetry))
    return found


def scene(objects, start=None, words=WORDS, symmetry=None):
    return Scene.of(Query(words, tuple(objects), start=start or home()), symmetry)


def moved(poses, place_m, turn):
    """Objects in a world that is turned, then shifted."""
    return tuple(
        replace(
            pose,
            position_m=turns.rotated(turn, pose.position_m) + place_m,
            quaternion_xyzw=turns.product(turn, pose.quaternion_xyzw),
        )
        for pose in poses
    )
