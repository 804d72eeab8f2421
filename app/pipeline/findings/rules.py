"""Which doubt about an answer is how severe: every rule by its name, with where its numbers come from.

This is the one place that decides what is a `danger`, on which robots stop. docs/findings.md describes the same rules,
and a test holds the two together.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from app.pipeline.findings import SEVERITIES, Finding, Severity

ALWAYS = 0.0


@dataclass(frozen=True)
class Rule:
    """From which value on a doubt is how severe.

    Attributes:
        code: of its findings.
        quantity: what the value is, with its unit; empty where there is one severity only.
        info, warning, danger: the least value of that severity; None where there is no such. Distances in metres.
        nearer: whether small values are the severe ones, so that these are the largest instead.
        source: where the numbers come from, and how often a right case had a danger by this rule.
    """

    code: str
    quantity: str = ""
    info: float | None = None
    warning: float | None = None
    danger: float | None = None
    nearer: bool = False
    source: str = ""

    @property
    def levels(self) -> dict[Severity, float]:
        """The severities that it can have, the lowest first, each with its value."""
        values = zip(SEVERITIES, (self.info, self.warning, self.danger), strict=True)
        return {severity: value for severity, value in values if value is not None}

    def severity(self, value: float = ALWAYS) -> Severity | None:
        """How severe the doubt is; None where there is none."""
        reached = [
            severity for severity, level in self.levels.items() if (value <= level if self.nearer else value >= level)
        ]
        return reached[-1] if reached else None

    def finding(
        self,
        message: str,
        where: str = "",
        numbers: Mapping[str, float] | None = None,
        *,
        value: float = ALWAYS,
    ) -> Finding:
        """The doubt as a finding.

        Raises:
            ValueError: for a value of no severity.
        """
        severity = self.severity(value)
        if severity is None:
            raise ValueError(f"{self.code} is no finding at {value}")
        return Finding(self.code, severity, message, where, numbers or {})


# Of the words.
UNFAMILIAR_INSTRUCTION = Rule("unfamiliar-instruction", danger=ALWAYS, source="what the request lets pass is unchecked")
NEW_INSTRUCTION = Rule("new-instruction", info=ALWAYS, source="its form was taught")
NEW_ROLE = Rule("new-role", "1 where taught words have it in another part, else 0", warning=0.0, danger=1.0)
OTHER_TASKS = Rule("other-tasks-demonstrations", danger=ALWAYS, source="docs/results/unseen.md: 1 of 38 scenes solved")

# Of the scene. False alarms: docs/results/findings.md.
UNCERTAIN_POSE = Rule("uncertain-pose", "confidence", info=1.0, warning=0.699999, nearer=True)
ONE_PLACE = Rule("objects-in-one-place", danger=ALWAYS)
TILTED = Rule("object-tilted", "degrees beyond every demonstration", danger=20.0)
HEIGHT = Rule("object-at-another-height", "m above or below every demonstration", warning=0.011, danger=0.018)
BEYOND = Rule("object-beyond-demonstrations", "m beyond the box of demonstrated places", warning=0.05, danger=0.30)
TURNED = Rule("object-turned", "degrees beyond the demonstrations", warning=10.0)
NOISY = Rule("noisy-observation", "m, the average error of poses", warning=0.016, danger=0.04)
ARRANGED = Rule("objects-arranged-otherwise", "m off a relation that all demonstrations share", warning=0.035)
PARTED = Rule("objects-arranged-otherwise", "m off a rigid arrangement that a row follows", warning=0.035, danger=0.05)

# Of the demonstrations.
SCATTERED = Rule("scattered-demonstrations", "m that their centre may be off", info=0.0, warning=0.012)
CONTRADICTING = Rule("scattered-demonstrations", "m from the centre, of more than a third", danger=0.08)
SEVERAL_WAYS = Rule("several-ways", "0 where the task says that there are several, else 1", info=0.0, danger=1.0)

# Of the actions.
STRAYING = Rule("straying-action", info=ALWAYS)
PASSES_CLOSE = Rule("passes-close", "m from an object's centre", warning=0.08, danger=0.03, nearer=True)
UNSUPPORTED = Rule("unsupported-action", danger=ALWAYS)
SAMPLES_DISAGREE = Rule("samples-disagree", warning=ALWAYS)
UNPARSABLE = Rule("unparsable-reply", danger=ALWAYS)
UNSAFE = Rule("unsafe-action", danger=ALWAYS)
MODEL_FAILED = Rule("model-failed", danger=ALWAYS)

RULES: tuple[Rule, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Rule))
