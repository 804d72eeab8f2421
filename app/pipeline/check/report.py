"""What a check of demonstrations found out: per plan, row and episode, in numbers."""

import math
from dataclasses import dataclass

from app.pipeline.findings import Finding
from app.pipeline.keyframes import Manner, Rule
from app.pipeline.representation.anchors import M_PER_RAD
from roboprompt_client.trajectory import EndEffectorAction


@dataclass(frozen=True)
class Off:
    """How far a pose is from another, in metres and degrees."""

    m: float
    deg: float

    @property
    def together_m(self) -> float:
        """Both as one distance: 10 degrees weigh as much as 1 cm."""
        return self.m + M_PER_RAD * math.radians(self.deg)


@dataclass(frozen=True)
class RowCheck:
    """One row of a plan, each demonstration's action held against what the others predict.

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
        """What the gripper does, one after the other: on the way to the first row, then at each switch."""
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

    rule: Rule
    plans: tuple[PlanCheck, ...]
    findings: tuple[Finding, ...] = ()
    unlike_ids: tuple[str, ...] = ()

    @property
    def num_episodes(self) -> int:
        """How many demonstrations were checked."""
        return sum(len(plan.episodes) for plan in self.plans)
