"""All that is noticed about a demonstration at its upload."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.pipeline.alike import Alike, alike_findings
from app.pipeline.episode import Demonstration
from app.pipeline.findings import Finding
from app.pipeline.findings.frames import Compared, compared_findings
from app.pipeline.findings.outliers import unlike_findings
from app.pipeline.findings.recording import contact_findings, recording_findings
from app.pipeline.findings.units import unit_findings
from app.pipeline.keyframes import KeyframeRule, Motion


def upload_findings(
    new: Demonstration,
    motion: Motion,
    rule: KeyframeRule,
    *,
    tracked: Sequence[str],
    alike: Sequence[Alike],
    compared: Sequence[Compared],
    extra: Mapping[str, Any],
    others: Sequence[Demonstration],
) -> tuple[Finding, ...]:
    """Return the findings, causes first.

    Args:
        new: the demonstration, with the keyframes that `rule` finds in `motion`.
        tracked: the objects in the order of the trajectory's tracks.
        alike: the objects that came with one name.
        compared: the objects whose poses were given, and found in images as well.
        extra: of the upload.
        others: the task's demonstrations.

    Raises:
        InvalidInputError: if `extra` has commanded positions of another shape.
    """
    return (
        *alike_findings(alike, new.instruction),
        *unit_findings(motion.trajectory, new.objects),
        *compared_findings(compared),
        *recording_findings(motion, new.actions, rule),
        *contact_findings(motion, tracked, extra),
        *unlike_findings(new, others),
    )
