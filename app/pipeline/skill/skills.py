"""The skills of a task's demonstrations: one for each form of instruction, fitted when it is first asked for."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from app.pipeline.episode import Query
from app.pipeline.order.order import Order
from app.pipeline.skill.recording import Recording
from app.pipeline.skill.scene import Scene
from app.pipeline.skill.skill import Skill, fit


@dataclass(frozen=True, eq=False)
class Skills:
    """What recordings of a task show.

    Attributes:
        recordings: of all instructions.
        symmetry: degrees after which an object looks the same, by its name; 0 for a round one.
    """

    recordings: tuple[Recording, ...]
    symmetry: Mapping[str, float]
    _fitted: dict[str, Skill] = field(default_factory=dict, init=False, repr=False)

    @property
    def forms(self) -> tuple[str, ...]:
        """The forms of instruction that recordings have."""
        return tuple(dict.fromkeys(item.order.form for item in self.recordings))

    def of(self, order: Order) -> Skill:
        """Return the skill that an instruction asks for.

        Where no recording has its form it is the most frequent one of as many clauses, or of any number.
        """
        return self.of_form(self._form(order))

    def of_form(self, form: str) -> Skill:
        """Return the skill of one of `forms`; fitted once."""
        if form not in self._fitted:
            alike = [item for item in self.recordings if item.order.form == form]
            self._fitted[form] = fit(alike, self.recordings)
        return self._fitted[form]

    def _form(self, order: Order) -> str:
        if order.form in self.forms:
            return order.form
        as_long = [item for item in self.recordings if len(item.order.clauses) == len(order.clauses)]
        return _usual(as_long or self.recordings)

    def scene(self, query: Query) -> Scene:
        """Return the scene of a query, symmetric objects turned to one side."""
        return Scene.of(query, self.symmetry)


def _usual(recordings: Sequence[Recording]) -> str:
    return Counter(item.order.form for item in recordings).most_common(1)[0][0]
