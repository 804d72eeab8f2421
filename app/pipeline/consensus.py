"""Several replies to one question -> one list of actions: a statistic of what the LLM said, never anything else."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.errors import ReplyParseError
from roboprompt_client.trajectory import EndEffectorAction


@dataclass(frozen=True)
class Consensus:
    """What most samples agree on.

    Attributes:
        used: indices of the samples that the actions are made of.
    """

    actions: tuple[EndEffectorAction, ...]
    used: tuple[int, ...]


def consensus(samples: Sequence[Sequence[EndEffectorAction] | None]) -> Consensus:
    """The median of those samples that have as many actions as most of them.

    Args:
        samples: the actions of each reply; None for a reply that was not a list of valid actions.

    Raises:
        ReplyParseError: unless more than half of the samples are valid and have the same number of actions.
    """
    lengths = Counter(len(actions) for actions in samples if actions is not None)
    length, votes = lengths.most_common(1)[0] if lengths else (0, 0)
    if 2 * votes <= len(samples):
        said = ", ".join("invalid" if actions is None else str(len(actions)) for actions in samples)
        message = f"no more than half of the {len(samples)} samples have the same number of actions ({said})"
        raise ReplyParseError(message, "")
    agreeing = {k: actions for k, actions in enumerate(samples) if actions is not None and len(actions) == length}
    rows = zip(*agreeing.values(), strict=True)
    return Consensus(tuple(median_action(row) for row in rows), tuple(agreeing))


def median_action(actions: Sequence[EndEffectorAction]) -> EndEffectorAction:
    """Of each coordinate the median, of the rotations the chordal mean, and what the gripper does in most.

    The chordal mean minimises the summed squared Frobenius distances of rotation matrices (Hartley et al. 2013,
    "Rotation Averaging"). Where the gripper's states are equally many, the first action's counts.
    """
    position_m = np.median([action.position_m for action in actions], axis=0)
    rotation = Rotation.from_quat([action.quaternion_xyzw for action in actions]).mean()
    num_open = sum(action.gripper_open for action in actions)
    tied = 2 * num_open == len(actions)
    is_open = actions[0].gripper_open if tied else 2 * num_open > len(actions)
    return EndEffectorAction(position_m, rotation.as_quat(canonical=True), is_open)
