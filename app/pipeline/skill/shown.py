"""Demonstrations as prompts show them: each with the rows of its plan, symmetric things turned alike."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from app.pipeline.episode import Demonstration
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.rows import Row, placed
from roboprompt_client.types.poses import EndEffectorAction


@dataclass(frozen=True, eq=False)
class Shown:
    """A demonstration with the rows of its plan.

    Attributes:
        demonstration: with symmetric objects turned as `rows` have them, and the actions that a prompt shows.
        rows: equal for all demonstrations of one plan.
    """

    demonstration: Demonstration
    rows: tuple[Row, ...]

    @property
    def id(self) -> str:
        """The demonstration's."""
        return self.demonstration.id


def shown_of(plan: Plan) -> Iterator[Shown]:
    """Yield the recordings of a plan; actions are those of its rows, or as they were where a rule gives the keyframes.

    What differs between recordings of one plan is noise, or follows nothing in the scene: a model that continues a
    pattern needs to see what is the same.
    """
    for n, item in enumerate(plan.members):
        scene, shown = plan.shown.scenes.one(n), item.demonstration
        actions = shown.actions
        if item.rule.aligned:
            places, hands = placed(plan.rows, scene)
            actions = tuple(EndEffectorAction.many(places, hands, plan.shown.gripper_open.tolist()))
        yield Shown(replace(shown, objects=scene.as_turned(shown), actions=actions), plan.rows)
