"""A skill: what demonstrations of one form of instruction share, and how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from app.pipeline.finding import LEVELS, Finding
from app.pipeline.skill import doubts
from app.pipeline.skill.density import SceneDensity, Surprise
from app.pipeline.skill.fit import Plan, plans_of
from app.pipeline.skill.left_out import left_out, scenes_left_out
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.scene import Scene
from roboprompt_client.types.poses import EndEffectorAction


@dataclass(frozen=True, eq=False)
class Skill:
    """What recordings of one form of instruction share.

    Attributes:
        form: of the instructions, see `app.pipeline.order`.
        plans: the ways of carrying it out; a scene calls for the first whose condition holds.
        scene: where objects and the hand are, learned from all recordings of the task.
    """

    form: str
    plans: tuple[Plan, ...]
    scene: SceneDensity
    recordings: tuple[Recording, ...]

    @property
    def objects(self) -> frozenset[str]:
        """The keys of the objects that rows follow or ways depend on."""
        return frozenset().union(*(doubts.keys_of(plan) for plan in self.plans))

    def plan_for(self, scene: Scene) -> Plan:
        """Return the plan that a scene calls for."""
        return next((plan for plan in self.plans if plan.holds(scene)), self.plans[0])

    @cached_property
    def usual(self) -> tuple[Plan, ...]:
        """The plans that a scene may call for, those of most recordings first."""
        called_for = [plan for plan in self.plans if plan.when] or [self.plans[0]]
        usual = [plan for plan in self.plans if not plan.when][:1]
        found = dict.fromkeys((*called_for, *usual)) if self.aligned else dict.fromkeys(self.plans)
        return tuple(sorted(found, key=lambda plan: -len(plan.members)))

    @property
    def aligned(self) -> bool:
        """Whether plans are what recordings share; else each keeps the keyframes that a rule gives it."""
        return self.recordings[0].rule.aligned

    def plans_for(self, scene: Scene) -> tuple[Plan, ...]:
        """Return the plans that a scene may call for: one, or all where a rule gives the keyframes."""
        if not self.aligned:
            return self.plans
        decides = {key for plan in self.plans for condition in plan.when for key in condition.keys}
        return (self.plan_for(scene),) if decides <= set(scene.keys) else self.usual[:1]

    def of_scene(self, scene: Scene) -> list[Finding]:
        """Return the doubts about a scene, which has the objects that rows follow."""
        plan, known = self.plan_for(scene), self.scene.among(scene.names)
        return [*doubts.of_scene(plan, known, scene), *doubts.alike(plan, scene)]

    @cached_property
    def of_demonstrations(self) -> tuple[Finding, ...]:
        """The doubts that do not depend on a scene."""
        found = doubts.of_demonstrations(self.plans, self.usual, self.recordings)
        return doubts.without_effects((*found, *map(doubts.of_left_out, self.left_out())))

    def left_out(self, most_p: float = LEVELS["unusual-demonstration"].warning) -> list[Surprise]:
        """Return what of each demonstration, its acts and its scene, is less probable than `most_p` by the others."""
        acts = [one for plan in self.plans for one in left_out(plan, most_p)]
        scenes, ids = [item.scene for item in self.recordings], [item.id for item in self.recordings]
        return sorted([*acts, *scenes_left_out(scenes, ids, most_p)], key=lambda one: one.p)

    def of_answer(self, actions: Sequence[EndEffectorAction], scene: Scene, most_p: float) -> list[Surprise]:
        """Return the coordinates of an answer's actions that are less probable than `most_p`."""
        plan = self.plan_for(scene)
        return doubts.of_answer(plan.rows, actions, plan.as_shown(scene), most_p)


def fit(
    recordings: Sequence[Recording], of_task: Sequence[Recording] | None = None, *, knows_start: bool = True
) -> Skill:
    """Return the skill of recordings whose instructions have one form.

    Args:
        of_task: all recordings in such scenes, also of other instructions; None: the same.
        knows_start: whether scenes will tell where the hand starts; else no row follows that.
    """
    density = SceneDensity.learned([item.scene for item in of_task or recordings])
    members = recordings if knows_start else [item.without_start for item in recordings]
    return Skill(recordings[0].order.form, plans_of(members), density, tuple(recordings))
