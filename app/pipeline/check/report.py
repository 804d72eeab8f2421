"""Results of a check of demonstrations: numbers for each plan, row and episode, and a model's reply for each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.keyframes import Manner, RuleName
from app.pipeline.thresholds import M_PER_RAD
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction
from roboprompt_client.types.severity import Severity

WRONG_M = 0.05  # rotation included; what a grasp hardly forgives


@dataclass(frozen=True)
class Off:
    """How far a pose is from another, in meters and degrees."""

    m: float
    deg: float

    @classmethod
    def median(cls, offs_m: Sequence[float] | Array, offs_deg: Sequence[float] | Array) -> "Off":
        """Return the median distance and the median angle."""
        return cls(float(np.median(offs_m)), float(np.median(offs_deg)))

    @property
    def together_m(self) -> float:
        """Both as one distance: 10 degrees count as 1 cm."""
        return self.m + M_PER_RAD * math.radians(self.deg)


@dataclass(frozen=True)
class RowCheck:
    """One row of a plan: each demonstration's action compared with the prediction of the others.

    Attributes:
        objects: which the row follows, of every demonstration; empty if it follows none.
        frame: along whose axes, as `Anchor.frame`.
        gripper_open: what the gripper does there in most.
        switches: whether the gripper opens or closes there.
        error: of the median demonstration; None without others.
        worst: of the worst demonstration.
        worst_id: of its episode.
        varies: how far the row is from its usual place in the world, in the median demonstration.
    """

    objects: tuple[str, ...]
    frame: str
    gripper_open: bool
    switches: bool
    varies: Off
    error: Off | None = None
    worst: Off | None = None
    worst_id: str | None = None


@dataclass(frozen=True, eq=False)
class EpisodeCheck:
    """One demonstration, predicted from the others of its plan.

    Attributes:
        actions: as prompts write them, before rows are made to agree.
        manner: how the recording moves.
        errors: of each row; empty without others.
        path_m: how far the recorded hand is at most from straight motion between the keyframes.
        path_left_m: the same where it matters.
    """

    id: str
    instruction: str
    actions: tuple[EndEffectorAction, ...]
    manner: Manner
    errors: tuple[Off, ...]
    path_m: float
    path_left_m: float


@dataclass(frozen=True, eq=False)
class PlanCheck:
    """Demonstrations that ask for the same and do it in the same rows.

    Attributes:
        asks_for: the instruction up to the objects that it names.
        shown: whether a prompt shows the plan; it leaves a rare one out.
    """

    asks_for: str
    shown: bool
    rows: tuple[RowCheck, ...]
    episodes: tuple[EpisodeCheck, ...]

    @property
    def instructions(self) -> tuple[str, ...]:
        """Of its demonstrations, each once."""
        return tuple(dict.fromkeys(episode.instruction for episode in self.episodes))

    @property
    def gripper(self) -> tuple[bool, ...]:
        """The states of the gripper in their order: on the way to the first row, then at each switch."""
        first = self.rows[:1]
        began = tuple(row.gripper_open != row.switches for row in first)
        return (*began, *(row.gripper_open for row in self.rows if row.switches))


@dataclass(frozen=True, eq=False)
class TaskCheck:
    """A task's demonstrations, each predicted from the others.

    Attributes:
        rule: of the keyframes.
        plans: those with most demonstrations first.
        findings: causes first.
        unlike_ids: of demonstrations that do not do as the others.
    """

    rule: RuleName
    plans: tuple[PlanCheck, ...]
    findings: tuple[Finding, ...] = ()
    unlike_ids: tuple[str, ...] = ()

    @property
    def num_episodes(self) -> int:
        """How many demonstrations were checked."""
        return sum(len(plan.episodes) for plan in self.plans)


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
    """Compare a reply's actions with the demonstration's."""
    if len(actions) != len(episode.actions):
        problem = f"{len(actions)} actions instead of {len(episode.actions)}"
        return ReplyCheck(episode.id, len(actions), problem=problem)
    pairs = list(zip(actions, episode.actions, strict=True))
    turned = [k for k, (predicted, shown) in enumerate(pairs) if predicted.gripper_open != shown.gripper_open]
    if turned:
        problem = f"the gripper has the other state in action {turned[0] + 1}"
        return ReplyCheck(episode.id, len(actions), problem=problem)
    return ReplyCheck(episode.id, len(actions), tuple(_off_between(*pair) for pair in pairs))


def _off_between(predicted: EndEffectorAction, shown: EndEffectorAction) -> Off:
    turn_rad = quaternions.angle_between_rad(shown.quaternion_xyzw, predicted.quaternion_xyzw)
    return Off(float(np.linalg.norm(predicted.position_m - shown.position_m)), math.degrees(turn_rad))


def reply_findings(model: str, replies: Sequence[ReplyCheck]) -> tuple[Finding, ...]:
    """Return a finding if the model's replies are wrong."""
    wrong = [reply for reply in replies if reply.is_wrong]
    if not wrong:
        return ()
    severity: Severity = "danger" if 2 * len(wrong) > len(replies) else "warning"
    shown = wrong[0].problem or f"{100 * max(off.m for off in wrong[0].errors):.1f} cm off"
    message = (
        f"{model} gets {len(wrong)} of {len(replies)} demonstrations wrong that its prompt did not show, the first"
        f" {wrong[0].id}: {shown}. Without other findings, try another model, representation or number of"
        " demonstrations."
    )
    numbers = {"wrong": len(wrong), "asked": len(replies)}
    return (Finding("model-mispredicts", severity, message, "replies", numbers),)
