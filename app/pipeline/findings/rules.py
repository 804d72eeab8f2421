"""Which doubt about an answer is how severe: every rule by its name, with where its numbers come from.

This is the one place that decides what is a `danger`, on which robots stop. docs/findings.md describes the same rules,
and a test holds the two together.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from app.pipeline.findings import Finding
from app.pipeline.thresholds import BEYOND_NOISE_M, TURNED_M
from roboprompt_client.types.severity import SEVERITIES, Severity

ALWAYS = 0.0
MEASURED = "thresholds: docs/results/safety.md; no danger in 1056 right scenes of 22 tasks"


@dataclass(frozen=True)
class Rule:
    """From which value on a doubt is how severe.

    Attributes:
        code: of its findings.
        quantity: what the value is; empty where there is one severity only.
        unit: of the value: m, degrees, or none.
        info, warning, danger: the least value of that severity; None where there is no such.
        nearer: whether small values are the severe ones, so that these are the largest instead.
        source: where the numbers come from, and how often right cases had a danger by this rule.
    """

    code: str
    quantity: str = ""
    unit: str = ""
    info: float | None = None
    warning: float | None = None
    danger: float | None = None
    nearer: bool = False
    source: str = MEASURED

    @property
    def levels(self) -> dict[Severity, float]:
        """The severities that it can have, the lowest first, each with its value."""
        values = zip(SEVERITIES, (self.info, self.warning, self.danger), strict=True)
        return {severity: value for severity, value in values if value is not None}

    def severity(self, value: float = ALWAYS) -> Severity | None:
        """How severe the doubt is; None where there is none."""
        sign = -1 if self.nearer else 1
        reached = [severity for severity, level in self.levels.items() if sign * value >= sign * level]
        return reached[-1] if reached else None

    def finding(
        self, message: str, where: str = "", numbers: Mapping[str, float] | None = None, *, value: float = ALWAYS
    ) -> Finding:
        """The doubt as a finding.

        Raises:
            ValueError: for a value of no severity.
        """
        severity = self.severity(value)
        if severity is None:
            raise ValueError(f"{self.code} is no finding at {value}")
        return Finding(self.code, severity, message, where, numbers or {})

    def findings(self, value: float, message: str, where: str, numbers: Mapping[str, float]) -> tuple[Finding, ...]:
        """The doubt, if the value has a severity."""
        return () if self.severity(value) is None else (self.finding(message, where, numbers, value=value),)


UNFAMILIAR_INSTRUCTION = Rule("unfamiliar-instruction", danger=ALWAYS, source="not one motion is taught for it")
NEW_INSTRUCTION = Rule("new-instruction", info=ALWAYS, source="its form was taught")
NEW_ROLE = Rule(
    "new-role", "1 if demonstrations have the object in another part", warning=0.0, danger=1.0, source="words"
)
PARTS_NOT_SHOWN = Rule("parts-not-shown", danger=ALWAYS, source="the reply is not held to demonstrations")

UNCERTAIN_POSE = Rule("uncertain-pose", "1 below a confidence of 0.7, else 0", info=0.0, warning=1.0)
OTHER_SOURCE = Rule("poses-of-another-source", "0 for a given pose that nothing compares", warning=0.0, danger=1.0)
ONE_PLACE = Rule("objects-in-one-place", danger=ALWAYS)
HEIGHTS_EXCHANGED = Rule("objects-in-each-others-place", "of both above or below", "m", danger=0.008)
OLD_SCENE = Rule("scene-of-a-demonstration", danger=ALWAYS, source="no measured pose repeats itself to 0.01 mm")
TILTED = Rule("object-tilted", "beyond every demonstration", "degrees", danger=20.0)
HEIGHT = Rule("object-at-another-height", "above or below every demonstration", "m", warning=0.011, danger=0.018)
# of 4510 right scenes a danger in 0.4 % with ten demonstrations, 3.6 % with five, 2.8 % with three
BEYOND = Rule("object-beyond-demonstrations", "beyond the widened box of places", "m", warning=0.05, danger=0.10)
START_BEYOND = Rule("start-beyond-demonstrations", "the same, of the hand", "m", warning=0.10, danger=0.20)
OTHER_FRAME = Rule("hand-in-another-frame", "share of the recordings", danger=0.34, source="docs/results/safety.md")
# a wrist cannot follow all the way round: people's stacks in robosuite, of three demonstrations
TURNED = Rule("object-turned", "beyond the demonstrations", "degrees", warning=10.0, danger=120.0)
# of ten or more demonstrations; a danger in 0.2 % of 10560 right scenes
TURNED_BEYOND_MANY = Rule("object-turned", "beyond the demonstrations", "degrees", warning=10.0, danger=20.0)
NOISY = Rule("noisy-observation", "the average error of poses", "m", warning=0.016, danger=0.03)
ARRANGED = Rule("objects-arranged-otherwise", "off what all demonstrations share", "m", warning=0.035)
FOLLOWED_ARRANGED = Rule("objects-arranged-otherwise", "off a rigid arrangement that a row follows", "m", danger=0.035)

SIDES = Rule("objects-arranged-otherwise", "on the side where no demonstration has it", "m", danger=0.05)

OTHER_OBJECTS = Rule("other-objects", info=ALWAYS, source="no row follows them and no words name them")
SYMMETRY_SHOWN = Rule("symmetry-shown", info=ALWAYS, source="docs/plans.md")
NUMBERED = Rule("numbered-by-place", info=ALWAYS, source="docs/instructions.md")
PLAN_OF_SCENE = Rule("plan-of-this-scene", info=ALWAYS, source="docs/plans.md")
SCENE_BETWEEN = Rule("scene-between-plans", warning=ALWAYS, source="docs/plans.md")
SCENE_BEYOND = Rule("scene-beyond-plans", danger=ALWAYS, source="docs/plans.md")
LEFT_OUT = Rule("left-out", info=ALWAYS, source="docs/plans.md")
NO_COMMON_PLAN = Rule("no-common-plan", warning=ALWAYS, source="docs/plans.md")
FEW_DEMONSTRATIONS = Rule(
    "few-demonstrations",
    "grasps of a single demonstration",
    info=ALWAYS,
    danger=2.0,
    source="what a row follows is known from three on: docs/plans.md",
)
MANY_ROWS = Rule("many-rows", warning=ALWAYS, source="the longer a reply, the more goes wrong")

SCATTERED = Rule("scattered-demonstrations", "that their center may be off", info=0.0, warning=0.012)
MISSED = Rule("scattered-demonstrations", "the same where the hand takes or presses", "m", danger=0.012)
APART = Rule("scattered-demonstrations", "rms of places that are alike along other axes", "m", danger=TURNED_M)
HAND_APART = Rule("scattered-demonstrations", "the same of the hand's rotations", "degrees", danger=10.0)
NOT_SHOWN_APART = Rule("scattered-demonstrations", danger=ALWAYS, source="the prompt's demonstrations are too few")
CONTRADICTING = Rule("scattered-demonstrations", "of a third from the center", "m", danger=BEYOND_NOISE_M)
EXPLAINED_AWAY = Rule("scattered-demonstrations", "from the center, where something explains it", "m", danger=0.015)
UNLIKE_MOST = Rule("scattered-demonstrations", "where most agree relative to another object", "m", danger=0.02)
TURNED_OTHERWISE = Rule("scattered-demonstrations", "that a third turn more or less", "degrees", danger=45.0)
SEVERAL_WAYS = Rule("several-ways", "0 where the task says that there are several, else 1", info=0.0, danger=1.0)
EXCHANGED = Rule("names-exchanged", "share of the demonstrations", danger=0.15)
ELSEWHERE = Rule("acts-elsewhere", "share; 1 where a place decides", info=0.0, warning=0.01, danger=0.21)
TURNED_IN_TWO = Rule("scattered-demonstrations", "between two turns of the hand where it acts", "degrees", danger=20.0)
TURNED_ANYHOW = Rule("scattered-demonstrations", "that a third are off, where it takes things", "degrees", danger=15.0)
NEVER_TURNED = Rule("scattered-demonstrations", "the same, of what seems never to turn", "degrees", warning=15.0)
ON_A_CIRCLE = Rule("scattered-demonstrations", "from the center, all at one distance from an object", "m", danger=0.03)
PATH_NOT_KEPT = Rule("path-not-kept", "from where recorded hands act to the nearest action", "m", danger=0.03)
PATH_LEFT = Rule("path-not-kept", "from the recorded way where the hand does not rest", "m", warning=0.03, danger=0.05)

IMPLAUSIBLE_GRIPPER = Rule("implausible-gripper", "share of the recordings", danger=0.34)
BROKEN_OFF = Rule("broken-off", "share of the recordings", warning=0.01, danger=0.21)
STOPS_COMPLETE = Rule("broken-off", "the same, where the ends agree and all has been done", warning=0.01)
BACKWARDS = Rule("backwards-in-time", danger=ALWAYS)
NOT_HELD = Rule("not-in-the-hand", "share of the recordings", danger=0.34, source="what is not held is not put down")
DROPS = Rule("drops-what-it-holds", danger=ALWAYS)
FAR_FROM_ALL = Rule("acts-far-from-objects", "from the nearest object", "m", warning=0.10, danger=0.15)
BESIDE = Rule("beside-the-object", "from the object's vertical axis", "m", danger=0.05)
OBJECT_W_FIRST = Rule("w-first", "share of the demonstrations", danger=0.15)
W_FIRST = Rule("w-first", "of the hand's rotations from their mean", "degrees", danger=6.0)
MISREAD = Rule("yaw-misread", "of the hand's rotations from their mean", "degrees", danger=8.0)

GRIPPER_TURNED = Rule("gripper-turned", info=ALWAYS, source="docs/plans.md")
STRAYING = Rule("straying-action", info=ALWAYS)
PASSES_CLOSE = Rule("passes-close", "from an object's center", "m", warning=0.08, danger=0.03, nearer=True)
UNSUPPORTED = Rule("unsupported-action", danger=ALWAYS)
SAMPLES_DISAGREE = Rule("samples-disagree", warning=ALWAYS, source="each reply is held to the demonstrations")
UNPARSABLE = Rule("unparsable-reply", danger=ALWAYS, source="there are no actions")
UNSAFE = Rule("unsafe-action", danger=ALWAYS, source="there are no actions")
MODEL_FAILED = Rule("model-failed", danger=ALWAYS, source="there are no actions")

RULES = tuple(value for value in list(globals().values()) if isinstance(value, Rule))
