"""Demonstrations of one plan as people record them: no two alike."""

from dataclasses import replace
from functools import cache

import numpy as np

from app.pipeline.episode import Demonstration
from app.pipeline.keyframes import KeyframeRule, Motion
from app.pipeline.plans.recording import Recording

from ..recordings import flowing, pick_and_place
from ..scenes import action, demonstration, pose

INSTRUCTION = "put the red cube on the plate"
LOW_M, HIGH_M = (-0.2, -0.35, 0.78), (0.4, 0.35, 0.8)


def recording(motion, objects, hz=20, instruction=INSTRUCTION, rule="auto"):
    """The motion as a demonstration's recording."""
    trajectory = motion.at(hz)
    shown = Demonstration(instruction, tuple(objects), (), start=trajectory.action_at(0))
    return Recording(shown, Motion.of(trajectory), KeyframeRule(rule))


def scene(random):
    """A cube and a plate, far enough from each other to be distinguished."""
    while True:
        cube_m, plate_m = random.uniform(LOW_M, HIGH_M, (2, 3))
        if np.linalg.norm(cube_m - plate_m) > 0.25:
            return pose("red cube", cube_m), pose("plate", plate_m)


def picks(seed, move=flowing):
    """A motion that puts the cube on the plate at a speed and height of its own, from a start of its own; its scene."""
    random = np.random.default_rng(seed)
    cube, plate = scene(random)
    motion = pick_and_place(
        cube.position_m,
        np.add(plate.position_m, [0, 0, 0.03]),
        move=move,
        above_m=0.12 + random.uniform(-0.01, 0.01),
        speed_m_s=random.uniform(0.12, 0.25),
        start_m=np.array([0.1, 0.0, 1.1]) + random.uniform(-0.03, 0.03, 3),
        tremor_m=random.uniform(0, 0.002) if move is flowing else 0.0,
    )
    return motion, (cube, plate)


@cache
def picked(seed, **how):
    """The same, recorded at one of several rates."""
    return recording(*picks(seed, **how), hz=np.random.default_rng(seed).choice([10, 15, 20, 30]))


def slipped(seed, again_s=1.6, times=1):
    """The cube is grasped, let go and, so long after the first time, grasped again; the hand waits for 2 s for each."""
    motion, objects = picks(seed)
    grasped_s = motion.switches[0]
    motion = motion.held(grasped_s, 2.0 * times)
    first, *others = motion.switches
    tries_s = [grasped_s + again_s * k / 2 for k in range(1, 2 * times + 1)]
    return recording(replace(motion, switches=(first, *tries_s, *others)), objects)


def reached(offsets_m, *, random, objects=None, instruction=INSTRUCTION, turns_deg=None):
    """Demonstrations of one action at these offsets from the cube, each in a scene of its own."""
    group = []
    for k, offset_m in enumerate(offsets_m):
        seen = scene(random) if objects is None else objects[k]
        turn_deg = 0 if turns_deg is None else turns_deg[k]
        only = action(seen[0].position_m + offset_m, (180, 0, turn_deg))
        group.append(replace(demonstration(instruction, seen, [only]), plan=0))
    return group
