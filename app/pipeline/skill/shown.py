"""Demonstrations as prompts show them: each with the rows of its plan, symmetric things turned alike."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Demonstration
from app.pipeline.skill.choice import choose
from app.pipeline.skill.fit import Plan
from app.pipeline.skill.recording import at_keyframes
from app.pipeline.skill.rows import Row, placed
from app.pipeline.skill.scene import Scene
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


def shown_as_they_are(demonstrations: Sequence[Demonstration]) -> list[Shown]:
    """Return demonstrations without their motion, each with the rows that those of its kind share."""
    rows: dict[int, tuple[Row, ...]] = {}
    kinds = [(item.order.form, tuple(action.gripper_open for action in item.actions)) for item in demonstrations]
    for kind in dict.fromkeys(kinds):
        places = [place for place, own in enumerate(kinds) if own == kind]
        alike = [demonstrations[place] for place in places]
        fitted = choose(at_keyframes(alike, [Scene.of(item) for item in alike])) if alike[0].actions else ()
        rows.update(dict.fromkeys(places, fitted))
    return [Shown(item, rows[place]) for place, item in enumerate(demonstrations)]
