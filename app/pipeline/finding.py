"""Findings: reasons for doubt, whose severity follows from how probable they are if nothing is wrong.

This is the one place that decides what is a `danger`, on which robots stop. docs/findings.md describes the same codes.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from roboprompt_client.types.severity import SEVERITIES, Severity


class Levels(NamedTuple):
    """The largest p of a warning, and of a danger; p = 0 is what cannot be, and -1 is never reached."""

    warning: float
    danger: float


NEVER = -1.0
# Calibrated on right and wrong cases of the adversary, seeds 7300 to 7401: right ones are stopped in 1 of 50. What is
# given in nats of evidence has p = exp(-nats)
LEVELS: Mapping[str, Levels] = {
    # Demonstrations
    "few-demonstrations": Levels(NEVER, NEVER),
    "another-convention": Levels(NEVER, float(np.exp(-8))),
    "names-exchanged": Levels(NEVER, float(np.exp(-6))),
    "unlike-words": Levels(NEVER, float(np.exp(-4))),  # of a third of the recordings
    "uncertain-act": Levels(NEVER, 0.8),  # the act succeeds: of cases without another doubt 83 % did to there
    "several-ways": Levels(NEVER, 0.66),  # a demonstration is of a known way
    "unusual-demonstration": Levels(1e-3, NEVER),
    "symmetry-shown": Levels(NEVER, NEVER),
    # Scenes
    "measured-twice": Levels(1.0, 1e-3),
    "unusual-scene": Levels(0.01, 1e-3),
    "uncertain-pose": Levels(0.7, 0.01),  # an estimator's confidence
    "new-instruction": Levels(0.5, 0.01),  # words that ask for what was taught
    # Answers
    "unusual-action": Levels(0.01, 1e-3),
    "passes-close": Levels(0.97, 0.2),  # nothing is hit
    "no-actions": Levels(NEVER, 0.0),
}


@dataclass(frozen=True)
class Finding:
    """One reason for doubt and its cause.

    Attributes:
        code: of `LEVELS`.
        severity: `info` explains, `warning` says that the result may be wrong, `danger` that it probably is.
        message: one sentence for people, with what to do where that is known.
        where: path of what it is about, e.g. ``objects[cup]`` or ``actions[2]``; empty for the whole.
        numbers: the quantities behind it, `p` among them.
    """

    code: str
    severity: Severity
    message: str
    where: str = ""
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def danger(self) -> bool:
        """Whether a robot stops."""
        return self.severity == "danger"

    def to_json(self) -> dict[str, Any]:
        """As answers carry it: the numbers stand beside the other members."""
        own = {"code": self.code, "severity": self.severity, "message": self.message, "where": self.where}
        return {**own, **self.numbers}


def finding(code: str, p: float, message: str, where: str = "", **numbers: float) -> Finding:
    """Return the finding.

    Args:
        p: how probable what was seen is if nothing is wrong.
    """
    levels = LEVELS[code]
    severity: Severity = "danger" if p <= levels.danger else "warning" if p <= levels.warning else "info"
    return Finding(code, severity, message, where, {"p": p, **numbers})


def without_repeats(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the severest finding of each code and place, in the order in which these come first."""
    found: dict[tuple[str, str], Finding] = {}
    for one in findings:
        key = one.code, one.where
        if key not in found or SEVERITIES.index(one.severity) > SEVERITIES.index(found[key].severity):
            found[key] = one
    return tuple(found.values())
