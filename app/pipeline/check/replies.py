"""What a language model makes of demonstrations: its actions for one that it was not shown, against what was done."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.pipeline.check.left_out import off_between
from app.pipeline.check.report import EpisodeCheck, Off
from app.pipeline.episode import EndEffectorAction
from app.pipeline.findings import Finding, Severity

WRONG_M = 0.05  # rotation included; what a grasp hardly forgives


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
