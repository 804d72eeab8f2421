"""What is doubtful about an observed scene, by itself and compared with those of the demonstrations."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.comparison import object_reach
from app.pipeline.episode import Demonstration, ObjectPose
from app.pipeline.findings import Finding, Severity
from app.pipeline.geometry import tilt_rad

BEYOND_M = 0.10  # unseen scenes reach a few centimetres beyond ten demonstrations
FAR_BEYOND_M = 0.30
ENOUGH = 3  # demonstrations from which on their places say something about what was taught
TILT_DEG = 20.0
UNSURE = 0.7  # of a pose


def scene_findings(observed: Sequence[ObjectPose], shown: Sequence[Demonstration]) -> tuple[Finding, ...]:
    """What deserves a look: each cause once, with the objects that it concerns.

    Args:
        shown: the demonstrations of the prompt, with the same objects; empty where they are not known.
    """
    return (*_uncertain(observed), *(finding for pose in observed for finding in _place(pose, shown)))


def _uncertain(observed: Sequence[ObjectPose]) -> Iterator[Finding]:
    for pose in observed:
        if pose.confidence < UNSURE or pose.reason:
            reason = f": {pose.reason}" if pose.reason else ""
            message = f"The pose of {pose.name} is not certain ({pose.estimator}, {pose.confidence:.2f}){reason}."
            severity: Severity = "warning" if pose.confidence < UNSURE else "info"
            numbers = {"confidence": pose.confidence}
            yield Finding("uncertain-pose", severity, message, f"objects[{pose.name}]", numbers)


def _place(pose: ObjectPose, shown: Sequence[Demonstration]) -> Iterator[Finding]:
    """Beyond the demonstrations nobody has shown that the rows hold."""
    if not shown:
        return
    reach = object_reach(pose, shown)
    beyond_m = float(np.abs(reach.beyond_m).max())
    if len(shown) >= ENOUGH and beyond_m > BEYOND_M:
        axis = int(np.argmax(np.abs(reach.beyond_m)))
        message = (
            f"{pose.name} lies {100 * beyond_m:.0f} cm beyond the demonstrations along {'xyz'[axis]}: they have it from"
            f" {reach.low_m[axis]:.3f} to {reach.high_m[axis]:.3f} m."
        )
        severity: Severity = "danger" if beyond_m > FAR_BEYOND_M else "warning"
        numbers = {"beyond_m": beyond_m}
        yield Finding("object-beyond-demonstrations", severity, message, f"objects[{pose.name}]", numbers)
    poses = [item for d in shown for item in d.objects if item.name == pose.name and item.quaternion_xyzw is not None]
    if pose.quaternion_xyzw is None or not poses:
        return
    tilts_deg = [np.degrees(tilt_rad(Rotation.from_quat(item.quaternion_xyzw))) for item in poses]
    tilt_deg = float(np.degrees(tilt_rad(Rotation.from_quat(pose.quaternion_xyzw))))
    off_deg = max(min(tilts_deg) - tilt_deg, tilt_deg - max(tilts_deg))
    if off_deg > TILT_DEG:
        message = f"{pose.name} is tilted by {tilt_deg:.0f} degrees, {off_deg:.0f} beyond the demonstrations."
        yield Finding("object-tilted", "danger", message, f"objects[{pose.name}]", {"tilt_deg": tilt_deg})
