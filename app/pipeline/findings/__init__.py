"""Findings: reasons why a recording, an observation or a prediction may be wrong."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from roboprompt_client.types.severity import SEVERITIES, Severity


@dataclass(frozen=True)
class Finding:
    """One reason for doubt and its cause.

    Attributes:
        code: kebab-case name of the kind, stable for programs.
        severity: `info` explains, `warning` says that the result may be wrong, `danger` that it probably is.
        message: one sentence for people, with what to do where that is known.
        where: path of what it is about, e.g. ``trajectory.timestamps`` or ``actions[2]``; empty for the whole.
        numbers: the quantities behind it, named with their units.
    """

    code: str
    severity: Severity
    message: str
    where: str = ""
    numbers: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """As answers carry it: the numbers stand beside the other members."""
        own = {"code": self.code, "severity": self.severity, "message": self.message, "where": self.where}
        return {**own, **self.numbers}


def worst_severity(findings: Iterable[Finding]) -> Severity | None:
    """The highest severity among the findings; None without any."""
    found = {finding.severity for finding in findings}
    return next((severity for severity in reversed(SEVERITIES) if severity in found), None)
