"""What is doubtful about a question before it is asked: the scene, the demonstrations, and how far they agree."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.comparison import object_reach
from app.pipeline.episode import Demonstration, ObjectPose
from app.pipeline.findings import Finding, Severity
from app.pipeline.geometry import tilt_rad
from app.pipeline.language import Grounded
from app.pipeline.plans.support import PlacedPlan
from app.services.question import Question

BEYOND_M = 0.10  # unseen scenes reach a few centimetres beyond ten demonstrations
FAR_BEYOND_M = 0.30
ENOUGH = 3  # demonstrations from which on their places say something about what was taught
TILT_DEG = 20.0
UNSURE = 0.7  # of a pose
SCATTER_M = 0.03
SCATTER_DEG = 25.0


def findings_before(question: Question) -> tuple[Finding, ...]:
    """What deserves a look before the robot moves, the cause first."""
    support = question.template.support
    if support is None:
        return (*_words(question.grounded), *_poses(question.observed))
    shown = [demonstration for group, _ in support.plans for demonstration in group]
    plans = [plan for placed in question.plans.values() for plan in placed or ()]
    return (
        *_words(question.grounded),
        *_poses(question.observed),
        *(finding for pose in question.observed for finding in _place(pose, shown)),
        *_scatter(plans),
    )


def _words(grounded: Grounded) -> Iterator[Finding]:
    if grounded.unfamiliar is not None:
        message = f"{grounded.unfamiliar}; it was passed on to the LLM."
        yield Finding("unfamiliar-instruction", "danger", message, "instruction")


def _poses(observed: tuple[ObjectPose, ...]) -> Iterator[Finding]:
    for pose in observed:
        if pose.confidence < UNSURE:
            message = (
                f"The pose of {pose.name} is not certain ({pose.estimator}, {pose.confidence:.2f}): {pose.reason}."
            )
            yield Finding(
                "uncertain-pose", "warning", message, f"objects[{pose.name}]", {"confidence": pose.confidence}
            )


def _place(pose: ObjectPose, shown: list[Demonstration]) -> Iterator[Finding]:
    """Beyond the demonstrations nobody has shown that the rows hold."""
    reach = object_reach(pose, shown)
    beyond_m = float(np.abs(reach.beyond_m).max())
    if len(shown) >= ENOUGH and beyond_m > BEYOND_M:
        axis = int(np.argmax(np.abs(reach.beyond_m)))
        message = (
            f"{pose.name} lies {100 * beyond_m:.0f} cm beyond the demonstrations along {'xyz'[axis]}: they have it from"
            f" {reach.low_m[axis]:.2f} to {reach.high_m[axis]:.2f} m."
        )
        severity: Severity = "danger" if beyond_m > FAR_BEYOND_M else "warning"
        yield Finding(
            "object-beyond-demonstrations", severity, message, f"objects[{pose.name}]", {"beyond_m": beyond_m}
        )
    poses = [item for d in shown for item in d.objects if item.name == pose.name and item.quaternion_xyzw is not None]
    if pose.quaternion_xyzw is None or not poses:
        return
    tilts_deg = [np.degrees(tilt_rad(Rotation.from_quat(item.quaternion_xyzw))) for item in poses]
    tilt_deg = float(np.degrees(tilt_rad(Rotation.from_quat(pose.quaternion_xyzw))))
    off_deg = max(min(tilts_deg) - tilt_deg, tilt_deg - max(tilts_deg))
    if off_deg > TILT_DEG:
        message = f"{pose.name} is tilted by {tilt_deg:.0f} degrees, {off_deg:.0f} beyond the demonstrations."
        yield Finding("object-tilted", "danger", message, f"objects[{pose.name}]", {"tilt_deg": tilt_deg})


def _scatter(plans: list[PlacedPlan]) -> Iterator[Finding]:
    """Where the gripper acts, demonstrations that scatter say that poses are noisy or an object is missing."""
    acting = [
        (k, row)
        for plan in plans
        for k, row in enumerate(plan)
        if k > 0 and plan[k - 1].grippers != row.grippers
        if row.tolerance_m > SCATTER_M or row.tolerance_deg > SCATTER_DEG
    ]
    if not acting:
        return
    k, row = max(acting, key=lambda item: item[1].tolerance_m)
    message = (
        f"Demonstrations scatter by {100 * row.tolerance_m:.1f} cm and {row.tolerance_deg:.0f} degrees where the"
        f" gripper acts (action {k + 1}, seen from {row.anchor.object_name or row.anchor.frame}): poses are noisy, or"
        " what it follows is not among the objects."
    )
    numbers = {"tolerance_m": row.tolerance_m, "tolerance_deg": row.tolerance_deg}
    yield Finding("scattered-demonstrations", "warning", message, f"actions[{k}]", numbers)
