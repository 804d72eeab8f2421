"""Demonstrations by Meta-World's scripted policies, recorded as a robot's controller would record them."""

from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.metaworld.tasks import FINGERS, HAND, Floats
from benchmarks.metaworld.world import World

AFTER_SUCCESS_STEPS = 5  # so long a demonstration goes on
DOWNWARD_XYZW = (1.0, 0.0, 0.0, 0.0)  # Meta-World's hand never turns
CLEAR_TRAVEL = 0.1  # of the fingers: what moves less has neither opened nor closed
RATES_HZ = (10, 20, 27, 40, 80)


@dataclass(frozen=True)
class Demonstration:
    """A successful run of a scripted policy, every step of it.

    Attributes:
        observation: (39) of the scene at the start.
        joint_velocities_rad_s: (T, 7).
        hand_m: (T, 3) positions of the hand in Meta-World's frame.
        fingers: (T) how far they are apart, measured: 1 open, 0 closed.
    """

    observation: Floats
    joint_velocities_rad_s: Floats
    hand_m: Floats
    fingers: Floats


def demonstrate(world: World, seed: int) -> Demonstration | None:
    """Run the scripted policy in the scene of that seed; None if it does not succeed."""
    first = observation = world.reset(seed)
    rows: list[tuple[Floats, Floats, float]] = []
    last_step = world.max_steps
    succeeded = False
    while len(rows) < last_step:
        rows.append((world.joint_velocities_rad_s(), observation[HAND].copy(), float(observation[FINGERS])))
        observation, done = world.step(world.policy(observation))
        if done and not succeeded:
            succeeded = True
            last_step = min(last_step, len(rows) + AFTER_SUCCESS_STEPS)
    if not succeeded:
        return None
    velocities, places, fingers = zip(*rows, strict=True)
    return Demonstration(first, np.array(velocities), np.array(places), np.array(fingers))


def thinning(step_hz: float, record_hz: float) -> int:
    """Every how many steps are recorded, so that the rate is the nearest to `record_hz`."""
    return max(1, round(step_hz / record_hz))


def trajectory(demonstration: Demonstration, every: int) -> dict[str, Floats]:
    """The arrays of an upload, of every so many steps."""
    places = demonstration.hand_m[::every]
    return {
        "joint_velocities": demonstration.joint_velocities_rad_s[::every],
        "end_effector_positions": places,
        "end_effector_quaternions_xyzw": np.tile(DOWNWARD_XYZW, (len(places), 1)),
        "gripper_open": gripper_open(demonstration.fingers[::every]).astype(float),
    }


def gripper_open(fingers: Floats) -> NDArray[np.bool_]:
    """Whether the gripper is open, by what its fingers do, which is later than what they are commanded.

    The threshold lies between the extremes of the recording; fingers that hardly move have been open throughout.

    Args:
        fingers: (T) how far they are apart.
    """
    low, high = fingers.min(), fingers.max()
    if high - low <= CLEAR_TRAVEL:
        return np.ones(len(fingers), np.bool_)
    return np.asarray(fingers > (low + high) / 2)


class DemonstrationCache:
    """A folder of demonstrations, failed ones included.

    Args:
        folder: one for each version of Meta-World; None keeps nothing.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    def get(self, world: World, task: str, seed: int) -> Demonstration | None:
        """As `demonstrate`, which runs only if the folder does not have its result."""
        if self._folder is None:
            return demonstrate(world, seed)
        path = self._folder / task / f"{seed}.npz"
        if not path.exists():
            _write(path, demonstrate(world, seed))
        with np.load(path) as arrays:
            return Demonstration(**arrays) if arrays else None


def _write(path: Path, made: Demonstration | None) -> None:
    """A file that is there is whole: it gets its name last."""
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {} if made is None else dict(zip((f.name for f in fields(made)), astuple(made), strict=True))
    unfinished = path.with_suffix(".part")
    with unfinished.open("wb") as file:
        np.savez_compressed(file, **arrays)
    unfinished.replace(path)
