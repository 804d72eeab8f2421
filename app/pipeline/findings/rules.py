"""Severity rules for findings about answers: every rule by its name, with the source of its numbers.

This is the one place that decides what is a `danger`, on which robots stop. docs/findings.md describes the same rules,
and a test holds the two together. A rule has its code as name; several rules of one code are named after what they
measure.
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
    """From which value on a finding has which severity.

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
        """Return the severity of a value; None where there is no finding."""
        sign = -1 if self.nearer else 1
        reached = [severity for severity, level in self.levels.items() if sign * value >= sign * level]
        return reached[-1] if reached else None

    def finding(
        self, message: str, where: str = "", numbers: Mapping[str, float] | None = None, *, value: float = ALWAYS
    ) -> Finding:
        """Return the finding.

        Raises:
            ValueError: for a value of no severity.
        """
        severity = self.severity(value)
        if severity is None:
            raise ValueError(f"{self.code} is no finding at {value}")
        return Finding(self.code, severity, message, where, numbers or {})

    def findings(self, value: float, message: str, where: str = "", **numbers: float) -> tuple[Finding, ...]:
        """Return the finding, or none for a value of no severity."""
        return () if self.severity(value) is None else (self.finding(message, where, numbers, value=value),)


# The words of a request
UNFAMILIAR_INSTRUCTION = Rule("unfamiliar-instruction", danger=ALWAYS, source="not one motion is taught for it")
NEW_INSTRUCTION = Rule("new-instruction", info=ALWAYS, source="its form was taught")
NEW_ROLE = Rule(
    "new-role", "1 if demonstrations have the object in another part", warning=0.0, danger=1.0, source="words"
)
PARTS_NOT_SHOWN = Rule("parts-not-shown", danger=ALWAYS, source="the reply is not held to demonstrations")

# The poses of the observed scene
UNCERTAIN_POSE = Rule("uncertain-pose", "1 below a confidence of 0.7, else 0", info=0.0, warning=1.0)
POSES_OF_ANOTHER_SOURCE = Rule(
    "poses-of-another-source", "0 for a given pose that nothing compares", warning=0.0, danger=1.0
)
OBJECTS_IN_ONE_PLACE = Rule("objects-in-one-place", danger=ALWAYS)
OBJECTS_IN_EACH_OTHERS_PLACE = Rule("objects-in-each-others-place", "height error of both", "m", danger=0.004)
SCENE_OF_A_DEMONSTRATION = Rule("scene-of-a-demonstration", danger=ALWAYS, source="no pose is measured twice alike")
OBJECT_TILTED = Rule("object-tilted", "tilt outside of its range", "degrees", danger=20.0)
OBJECT_AT_ANOTHER_HEIGHT = Rule(
    "object-at-another-height", "distance from the nearest height", "m", warning=0.011, danger=0.018
)
# of 4510 right scenes a danger in 0.4 % with ten demonstrations, 3.6 % with five, 2.8 % with three
OBJECT_BEYOND_DEMONSTRATIONS = Rule(
    "object-beyond-demonstrations", "distance from the widened box of places", "m", warning=0.05, danger=0.10
)
# No demonstration shows whether the hand follows it. The paper's estimator errs by more in one of twenty poses
OBJECT_OFF_ITS_ONE_PLACE = Rule(
    "object-beyond-demonstrations", "distance from one place", "m", warning=0.02, danger=0.03
)
START_BEYOND_DEMONSTRATIONS = Rule("start-beyond-demonstrations", "the hand's distance", "m", warning=0.10, danger=0.20)
HAND_IN_ANOTHER_FRAME = Rule("hand-in-another-frame", "share of the recordings", danger=0.34)
# a wrist cannot follow all the way round: people's stacks in robosuite, of three demonstrations
OBJECT_TURNED = Rule("object-turned", "yaw outside of its range", "degrees", warning=10.0, danger=120.0)
# of ten or more demonstrations; a danger in 0.2 % of 10560 right scenes
OBJECT_TURNED_OF_MANY = Rule("object-turned", "yaw outside of its range", "degrees", warning=10.0, danger=20.0)
OBJECT_TURNED_ALONE = Rule("object-turned", "the same, where the hand need not turn with it", "degrees", warning=10.0)
NOISY_OBSERVATION = Rule("noisy-observation", "mean error of poses", "m", warning=0.016, danger=0.03)
SOME_ROTATIONS_NOT_MEASURED = Rule("rotation-not-measured", "share of the demonstrations", warning=0.0, danger=0.15)
ROTATION_NOT_MEASURED = Rule("rotation-not-measured", danger=ALWAYS, source="no measured one is exactly 0")
# poses with a mean error of 0.5 cm: at most 1.6 cm in 600 right scenes of three rigid arrangements; along one axis of
# three others none of 1500 is 2.5 cm off
ARRANGEMENT = Rule("objects-arranged-otherwise", "distance from a constant relative place", "m", warning=0.025)
ARRANGEMENT_OF_FOLLOWED = Rule("objects-arranged-otherwise", "the same, of what a row follows", "m", danger=0.025)
ARRANGEMENT_OF_SIDES = Rule("objects-arranged-otherwise", "distance on the wrong side", "m", danger=0.05)

# Which demonstrations a prompt shows
OTHER_OBJECTS = Rule("other-objects", info=ALWAYS, source="no row follows them and no words name them")
SYMMETRY_SHOWN = Rule("symmetry-shown", info=ALWAYS, source="docs/plans.md")
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

# Demonstrations that differ where the hand acts, relative to what the row follows
SCATTER_OF_CENTER = Rule("scattered-demonstrations", "standard error of the center", info=0.0, warning=0.012)
SCATTER_OF_CENTER_AT_TOUCH = Rule("scattered-demonstrations", "the same, at a grasp or press", "m", danger=0.012)
SCATTER_OF_PLACES_BY_AXES = Rule("scattered-demonstrations", "rms along the wrong axes", "m", danger=TURNED_M)
SCATTER_OF_HANDS_BY_AXES = Rule("scattered-demonstrations", "rms about the wrong axes", "degrees", danger=10.0)
SCATTER_OF_A_THIRD = Rule("scattered-demonstrations", "distance that a third exceed", "m", danger=BEYOND_NOISE_M)
# The center is half of it off, as of SCATTER_OF_CENTER_AT_TOUCH
SCATTER_OF_PLACES_IN_TWO = Rule("scattered-demonstrations", "between two clusters of places", "m", danger=0.024)
SCATTER_BESIDE_A_CORE = Rule("scattered-demonstrations", "of a third from where half agree", "m", danger=0.015)
SCATTER_EXPLAINED = Rule("scattered-demonstrations", "distance that something explains", "m", danger=0.015)
SCATTER_OF_TURN_OF_HELD = Rule("scattered-demonstrations", "turn that a third exceed", "degrees", danger=45.0)
SCATTER_OF_HANDS_IN_TWO = Rule("scattered-demonstrations", "angle between two clusters", "degrees", danger=20.0)
SCATTER_OF_HANDS = Rule("scattered-demonstrations", "angle that a third exceed at a grasp", "degrees", danger=15.0)
SCATTER_OF_HANDS_AT_UNTURNED = Rule("scattered-demonstrations", "of what never turns", "degrees", warning=15.0)
NOT_SHOWN = Rule("scattered-demonstrations", "between plans of the prompt and of the task", "m", danger=0.02)
SCATTER_ON_A_CIRCLE = Rule("scattered-demonstrations", "at one distance from a round object", "m", danger=0.03)
SCATTER_ON_AN_ARC = Rule("scattered-demonstrations", "the same, unlike the object's yaw", "m", danger=0.02)
SEVERAL_WAYS = Rule("several-ways", "0 where the task says that there are several, else 1", info=0.0, danger=1.0)
# 4 cm: clusters that are nearer to each other are one way (plans.ways)
WAY_BESIDE = Rule("several-ways", "from every object, where another way acts at one", "m", danger=0.04)
NAMES_EXCHANGED = Rule("names-exchanged", "share of the demonstrations", danger=0.15)
ACTS_ELSEWHERE = Rule("acts-elsewhere", "share; 1 where a place decides", info=0.0, warning=0.01, danger=0.21)
PATH_NOT_KEPT = Rule("path-not-kept", "from where recorded hands act to the nearest action", "m", danger=0.03)
PATH_NOT_KEPT_BETWEEN = Rule("path-not-kept", "from the path where the hand moves", "m", warning=0.03, danger=0.05)
PATH_LEFT_BY_SOME = Rule("path-not-kept", "the same, where more than half take the straight way", "m", warning=0.03)

# What recorded hands did
IMPLAUSIBLE_GRIPPER = Rule("implausible-gripper", "share of the recordings", danger=0.34)
BROKEN_OFF = Rule("broken-off", "share of the recordings", warning=0.01, danger=0.21)
BROKEN_OFF_COMPLETE = Rule("broken-off", "the same, where the ends agree and all has been done", warning=0.01)
BACKWARDS_IN_TIME = Rule("backwards-in-time", danger=ALWAYS)
BEGUN_LATE = Rule("begun-late", "all at one place seen from an object (0), or on the way (1)", warning=0, danger=1)
NOT_IN_THE_HAND = Rule("not-in-the-hand", "share of the recordings", danger=0.34)
DROPS_WHAT_IT_HOLDS = Rule("drops-what-it-holds", danger=ALWAYS)
ACTS_FAR_FROM_OBJECTS = Rule("acts-far-from-objects", "from the nearest object", "m", warning=0.10, danger=0.15)
# AT_OBJECT_M: what stands farther away is not what the hand closes on
SOME_ACT_FAR_FROM_OBJECTS = Rule("acts-far-from-objects", "of a third, where a third act at one", "m", danger=0.12)
BESIDE_THE_OBJECT = Rule("beside-the-object", "from the object's vertical axis", "m", danger=0.05)
W_FIRST_OF_OBJECT = Rule("w-first", "share of the demonstrations", danger=0.15)
W_FIRST = Rule("w-first", "of the hand's rotations from their mean", "degrees", danger=6.0)
YAW_MISREAD = Rule("yaw-misread", "of the hand's rotations from their mean", "degrees", danger=8.0)

# An answer
GRIPPER_TURNED = Rule("gripper-turned", info=ALWAYS, source="docs/plans.md")
STRAYING_ACTION = Rule("straying-action", info=ALWAYS)
PASSES_CLOSE = Rule("passes-close", "from an object's center", "m", warning=0.08, danger=0.03, nearer=True)
UNSUPPORTED = Rule("unsupported-action", danger=ALWAYS)
UNPARSABLE = Rule("unparsable-reply", danger=ALWAYS, source="there are no actions")
UNSAFE = Rule("unsafe-action", danger=ALWAYS, source="there are no actions")
MODEL_FAILED = Rule("model-failed", danger=ALWAYS, source="there are no actions")

RULES = tuple(value for value in list(globals().values()) if isinstance(value, Rule))
