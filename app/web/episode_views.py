"""What an episode's page shows of it: as the LLM reads it, and the keyframes that a rule would find."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.pipeline.keyframes import Motion, find_keyframes
from app.pipeline.representation import fit_codec
from app.pipeline.representation.base import REPRESENTATIONS, usual_format
from app.pipeline.skill.shown import Shown
from app.pipeline.spans import Span, prompt_spans
from app.pipeline.workspace import DiscreteAction, discretize_actions
from app.services.setting_parts import KeyframeSettings
from app.services.task_settings import TaskSettings
from app.store.values import JsonObject
from app.web.scene import frame
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction

MAX_SHOWN = 300  # a rule may take every frame of a long episode, more than a browser can draw


@dataclass(frozen=True)
class PreviewedKeyframe:
    """A keyframe that would be found.

    Attributes:
        number: from 1, as plots and the 3D view name it.
        new: whether it is not among the stored ones.
    """

    number: int
    index: int
    time_s: float
    action: EndEffectorAction
    discrete: DiscreteAction
    new: bool


@dataclass(frozen=True)
class Preview:
    """What would become of an episode's keyframes.

    Attributes:
        dropped: index and time of the stored ones that would not be found.
    """

    rule: KeyframeSettings
    keyframes: tuple[PreviewedKeyframe, ...]
    dropped: tuple[tuple[int, float], ...]

    @property
    def shown(self) -> tuple[PreviewedKeyframe, ...]:
        """Those that tables and plots show."""
        return self.keyframes[:MAX_SHOWN]

    @property
    def summary(self) -> str:
        """For example ``4 keyframes: 1 new, 2 of the stored ones gone``."""
        number = len(self.keyframes)
        counted = f"{number} keyframe{'' if number == 1 else 's'}"
        new = sum(item.new for item in self.keyframes)
        changes = [f"{new} new"] * bool(new) + [f"{len(self.dropped)} of the stored ones gone"] * bool(self.dropped)
        return f"{counted}: {', '.join(changes)}" if changes else f"{counted}, as stored"

    def document(self) -> JsonObject:
        """As the page's scripts draw it."""
        frames = [
            frame(
                str(item.number),
                item.action.position_m.tolist(),
                item.action.quaternion_xyzw.tolist(),
                gripper_open=item.action.gripper_open,
            )
            for item in self.shown
        ]
        shown = [{"number": item.number, "time_s": item.time_s, "new": item.new} for item in self.shown]
        return {"keyframes": shown, "dropped_s": [time_s for _, time_s in self.dropped], "frames": frames}


def preview(motion: Motion, rule: KeyframeSettings, stored: Sequence[int], settings: TaskSettings) -> Preview:
    """What `rule` finds in the recording.

    Args:
        stored: the indices of the stored keyframes.
    """
    found, times_s = find_keyframes(motion, rule.keyframe_rule()), motion.times_s
    workspace = settings.workspace.workspace()
    actions = [motion.trajectory.action_at(index, gripper_open=gripper_open) for index, gripper_open in found]
    keyframes = tuple(
        PreviewedKeyframe(number, index, float(times_s[index]), action, discrete, index not in stored)
        for number, ((index, _), action, discrete) in enumerate(
            zip(found, actions, discretize_actions(actions, workspace), strict=True), start=1
        )
    )
    frames = {keyframe.frame for keyframe in found}
    dropped = tuple((index, float(times_s[index])) for index in stored if index not in frames)
    return Preview(rule, keyframes, dropped)


@dataclass(frozen=True)
class EpisodeText:
    """A demonstration's part of a prompt.

    Attributes:
        usual: whether a request that names no representation gets this one.
        spans: colored as in the paper; empty where there is an error.
        error: why it cannot be written so, in words.
    """

    representation: str
    prompt_format: str
    usual: bool
    spans: tuple[Span, ...]
    error: str = ""


def episode_texts(
    written: Sequence[Shown],
    shown: int,
    settings: TaskSettings,
    usual_representation: str,
    format_asked: str,
) -> tuple[EpisodeText, ...]:
    """One of the demonstrations of a prompt in each representation, the usual first.

    Args:
        written: the demonstrations as the prompt shows them.
        shown: which of them.
    """
    texts = []
    for name in sorted(REPRESENTATIONS, key=lambda name: name != usual_representation):
        usual = name == usual_representation
        prompt_format = format_asked if usual else usual_format(name, format_asked)
        try:
            codec = fit_codec(name, prompt_format, written, settings.workspace.workspace())
            text, error = codec.demonstration_text(written[shown].demonstration), ""
        except InvalidInputError as refused:
            text, error = "", str(refused)
        texts.append(EpisodeText(name, prompt_format, usual, prompt_spans(text, name, prompt_format), error))
    return tuple(texts)
