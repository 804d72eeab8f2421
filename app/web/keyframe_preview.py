"""The keyframes that a rule would find, against those that are stored."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.pipeline.episode import CONTROL_FREQUENCY_HZ
from app.pipeline.keyframes import find_keyframes
from app.pipeline.workspace import discretize_action
from app.services.task_settings import KeyframeSettings, TaskSettings
from app.store.values import JsonObject
from app.web.scene3d import frame
from roboprompt_client.arrays import Array
from roboprompt_client.trajectory import Trajectory

MAX_SHOWN = 300  # a rule that takes every frame of a long episode would bring a browser to its knees


@dataclass(frozen=True)
class PreviewedKeyframe:
    """A keyframe that would be found.

    Attributes:
        number: from 1, as plots and the 3D view name it.
        new: whether it is not among the stored ones.
        clamped: whether the workspace does not contain its position.
    """

    number: int
    index: int
    time_s: float
    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]
    gripper_open: bool
    bins: tuple[int, ...]
    clamped: bool
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
            frame(str(item.number), item.position_m, item.quaternion_xyzw, gripper_open=item.gripper_open)
            for item in self.shown
        ]
        shown = [{"number": item.number, "time_s": item.time_s, "new": item.new} for item in self.shown]
        return {"keyframes": shown, "dropped_s": [time_s for _, time_s in self.dropped], "frames": frames}


def preview(
    trajectory: Trajectory, times_s: Array, rule: KeyframeSettings, stored: Sequence[int], settings: TaskSettings
) -> Preview:
    """What `rule` finds in the trajectory.

    Args:
        times_s: (T,) of its frames.
        stored: the indices of the stored keyframes.
    """
    hz = 1 / float(np.median(np.diff(times_s))) if len(times_s) > 1 else CONTROL_FREQUENCY_HZ
    found = find_keyframes(trajectory, rule.keyframe_rule(), hz)
    workspace = settings.workspace.workspace()
    keyframes = []
    for number, (index, gripper_open) in enumerate(found, start=1):
        action = trajectory.action_at(index, gripper_open=gripper_open)
        discrete = discretize_action(action, workspace)
        keyframes.append(
            PreviewedKeyframe(
                number,
                index,
                float(times_s[index]),
                tuple(action.position_m.tolist()),
                tuple(action.quaternion_xyzw.tolist()),
                action.gripper_open,
                discrete.bins,
                discrete.clamped,
                index not in stored,
            )
        )
    frames = {keyframe.frame for keyframe in found}
    dropped = tuple((index, float(times_s[index])) for index in stored if index not in frames)
    return Preview(rule, tuple(keyframes), dropped)
