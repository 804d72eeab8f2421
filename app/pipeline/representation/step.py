"""What rows of demonstrations have in common in whichever scene: a step at an object."""

from typing import NamedTuple

from app.pipeline.episode import Demonstration
from app.pipeline.order.order import Order
from app.pipeline.representation.anchors import Anchor, Frame
from app.pipeline.representation.object_rows import Row


class Step(NamedTuple):
    """What a row does at an object, in whichever scene and whatever the object's name.

    Attributes:
        form: of the instruction.
        role: place of the object in the instruction, or the name of one that it does not mention.
        along: the same of what the row follows along other axes.
        tenths: of the way there.
        numbers: of the row, relative to the object in `frame`.
    """

    form: str
    role: int | str
    frame: Frame
    along: tuple[tuple[int, int | str], ...]
    tenths: int
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, demonstration: Demonstration, row: Row) -> "Step":
        """The step of a demonstration's row."""
        order, anchor = demonstration.order, row.anchor
        roles = {name: place for place, name in enumerate(order.objects)}
        along = tuple((axis, roles.get(name, name)) for axis, name in anchor.along)
        role = roles.get(anchor.object_name, anchor.object_name)
        return cls(order.form, role, anchor.frame, along, anchor.tenths, row.numbers)

    def anchor(self, order: Order) -> Anchor:
        """What it is relative to where `order`, which has its form, is carried out."""
        name, *others = (
            order.objects[role] if isinstance(role, int) else role
            for role in (self.role, *(role for _, role in self.along))
        )
        axes = (axis for axis, _ in self.along)
        return Anchor(name, self.frame, tuple(zip(axes, others, strict=True)), self.tenths)
