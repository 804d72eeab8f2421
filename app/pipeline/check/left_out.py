"""Each demonstration predicted without itself: its rows from the others' rows, or its actions by a language model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.check.report import EpisodeCheck, Off
from app.pipeline.findings import Finding, Severity
from app.pipeline.plans import PlanRow
from app.pipeline.plans.rows import robust_centre
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import EndEffectorAction

WRONG_M = 0.05  # rotation included; what a grasp hardly forgives


def left_out(row: PlanRow) -> list[Off]:
    """How far each of at least two demonstrations is from where the others predict it.

    The others' centre is placed in the demonstration's own scene: distances and angles are the same there as seen from
    what the row follows.
    """
    number = len(row.offsets_m)
    return [_from_others(row, np.arange(number) != place, place) for place in range(number)]


def _from_others(row: PlanRow, others: np.ndarray, place: int) -> Off:
    centre_m, mean = robust_centre(row.offsets_m[others], row.rotations[others])
    return _off(row.offsets_m[place] - centre_m, mean.inv() * row.rotations[place])


def _off(way_m: Array, turn: Rotation) -> Off:
    return Off(float(np.linalg.norm(way_m)), float(np.degrees(turn.magnitude())))


def median_off(offs: list[Off]) -> Off:
    """The middle distance and the middle angle."""
    return Off(float(np.median([off.m for off in offs])), float(np.median([off.deg for off in offs])))


def variation(actions: list[EndEffectorAction]) -> Off:
    """How far the median action is from the actions' centre in the world."""
    positions_m = np.array([action.position_m for action in actions])
    rotations = Rotation.from_quat([action.quaternion_xyzw for action in actions])
    centre_m, mean = robust_centre(positions_m, rotations)
    return median_off([_off(m, turn) for m, turn in zip(positions_m - centre_m, mean.inv() * rotations, strict=True)])


def off_between(predicted: EndEffectorAction, shown: EndEffectorAction) -> Off:
    """How far a predicted action is from the demonstrated one."""
    turn = Rotation.from_quat(shown.quaternion_xyzw).inv() * Rotation.from_quat(predicted.quaternion_xyzw)
    return _off(predicted.position_m - shown.position_m, turn)


@dataclass(frozen=True)
class ReplyCheck:
    """A model's reply for one demonstration.

    Attributes:
        id: of the episode.
        num_actions: of the reply; None where it gave none.
        errors: of each action; empty where there are more or fewer than the demonstration has.
        problem: why there are no actions to compare; empty if there are.
    """

    id: str
    num_actions: int | None
    errors: tuple[Off, ...] = ()
    problem: str = ""

    @property
    def is_wrong(self) -> bool:
        """Whether a robot that did as the reply says would do something else."""
        return not self.errors or max(off.together_m for off in self.errors) > WRONG_M


def check_reply(episode: EpisodeCheck, actions: Sequence[EndEffectorAction]) -> ReplyCheck:
    """Hold a reply's actions against the demonstration's own."""
    if len(actions) != len(episode.actions):
        problem = f"{len(actions)} actions instead of {len(episode.actions)}"
        return ReplyCheck(episode.id, len(actions), problem=problem)
    pairs = list(zip(actions, episode.actions, strict=True))
    turned = [k for k, (predicted, shown) in enumerate(pairs) if predicted.gripper_open != shown.gripper_open]
    if turned:
        problem = f"the gripper is the other way in action {turned[0] + 1}"
        return ReplyCheck(episode.id, len(actions), problem=problem)
    return ReplyCheck(episode.id, len(actions), tuple(off_between(predicted, shown) for predicted, shown in pairs))


def reply_findings(model: str, replies: Sequence[ReplyCheck]) -> tuple[Finding, ...]:
    """Whether the model fails."""
    wrong = [reply for reply in replies if reply.is_wrong]
    if not wrong:
        return ()
    severity: Severity = "danger" if 2 * len(wrong) > len(replies) else "warning"
    shown = wrong[0].problem or f"{100 * max(off.m for off in wrong[0].errors):.1f} cm off"
    message = (
        f"{model} gets {len(wrong)} of {len(replies)} demonstrations wrong that it was not shown, the first"
        f" {wrong[0].id}: {shown}. If nothing else is found, try another model, representation or number of"
        " demonstrations."
    )
    numbers = {"wrong": len(wrong), "asked": len(replies)}
    return (Finding("model-mispredicts", severity, message, "replies", numbers),)
