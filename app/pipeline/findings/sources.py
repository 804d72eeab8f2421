"""Whether the poses of a scene and of demonstrations come from one source: others may mean other points and axes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.rules import OTHER_SOURCE
from roboprompt_client.types.poses import ObjectPose

SAME_M, SAME_DEG = 0.015, 15.0  # between a pose that was given and one that was found where both mean the same
REPEATED_M = 0.001  # a given pose so near to a demonstration's is that demonstration's
GIVEN = "given"


@dataclass(frozen=True)
class Compared:
    """An object of which an episode has a given pose, and images in which it was found.

    Attributes:
        turn_deg: about its z axis that leaves it unchanged: 0 any, None none.
    """

    given: ObjectPose
    found: ObjectPose
    turn_deg: float | None = None

    @property
    def off_m(self) -> float:
        """Between the two places."""
        return float(np.linalg.norm(self.given.position_m - self.found.position_m))

    @property
    def off_deg(self) -> float:
        """Between the two rotations, as small as the symmetry allows; 0 where one is not known."""
        if self.given.quaternion_xyzw is None or self.found.quaternion_xyzw is None:
            return 0.0
        between = Rotation.from_quat(self.given.quaternion_xyzw).inv() * Rotation.from_quat(self.found.quaternion_xyzw)
        if self.turn_deg == 0:
            return float(np.degrees(np.arccos(np.clip(between.as_matrix()[2, 2], -1, 1))))
        turns = Rotation.from_euler("z", np.arange(0, 360, self.turn_deg or 360)[:, None], degrees=True)
        return float(np.degrees((between * turns).magnitude().min()))

    @property
    def agrees(self) -> bool:
        """Whether both mean the same point and axes of the object."""
        return self.off_m <= SAME_M and self.off_deg <= SAME_DEG


def source_findings(
    observed: Sequence[ObjectPose], shown: Sequence[Demonstration], compared: Sequence[Compared]
) -> Iterator[Finding]:
    """Objects whose poses come from another source than those of demonstrations, unless both were seen to agree.

    Args:
        compared: of the task's episodes, where they have a given and a found pose.
    """
    for pose in observed:
        taught = [item for one in shown for item in one.objects if item.name == pose.name]
        sources = {item.estimator for item in taught} - {pose.estimator}
        repeated = any(np.linalg.norm(pose.position_m - item.position_m) < REPEATED_M for item in taught)
        if not sources or (repeated and pose.estimator == GIVEN):  # it was read from an episode
            continue
        measured = [item for item in compared if item.given.name == pose.name]
        if not measured or not all(item.agrees for item in measured):
            yield _finding(pose, sources, measured)


def _finding(pose: ObjectPose, sources: set[str], measured: Sequence[Compared]) -> Finding:
    now = "was given" if pose.estimator == GIVEN else f"was found in images ({pose.estimator})"
    then = " or ".join("given" if source == GIVEN else f"found in images ({source})" for source in sorted(sources))
    message = f"The pose of {pose.name} {now}, those of demonstrations were {then}: "
    numbers = {}
    if measured:
        off_m, off_deg = max(item.off_m for item in measured), max(item.off_deg for item in measured)
        numbers = {"off_m": off_m, "off_deg": off_deg}
        message += (
            f"where episodes have both, they are up to {100 * off_m:.1f} cm and {off_deg:.0f} degrees apart, so that"
            " they mean another point or other axes of the object."
        )
    else:
        message += (
            "nothing shows that they mean the same point and axes of the object. An episode with a given pose and"
            " images with color and depth would."
        )
    worse = bool(measured) or pose.estimator != GIVEN
    return OTHER_SOURCE.finding(message, f"objects[{pose.name}]", numbers, value=float(worse))
