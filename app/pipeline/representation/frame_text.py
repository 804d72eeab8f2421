"""A row's frame as text: an object's letter and a few words, as rows of `object_frame` write it.

::

    A w            at A's place, along the world's axes
    A o            along A's own axes; `ow` for the offset and not the rotation, `wo` the reverse
    A o>B          along level axes of which x points from A to B
    A/B w          midway between A and B
    A w z=world    at a height of the world; `x=C`: C's x
    A w axes=B     along B's axes; `hand=B`: the rotation is relative to B's
    world, start   at the origin of the world, or where the hand was at first
"""

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from app.pipeline.skill.frames import Frame
from app.pipeline.skill.scene import WORLD, Source

XYZ = "xyz"
CODES = ("w", "o", "ow", "wo")
PATTERN = (
    r"(?:[A-Z]{1,2}(?:/[A-Z]{1,2})? (?:ow|wo|[wo])(?:>[A-Z]{1,2})?|world|start)"
    r"(?: (?:[xyz]|axes|hand)=(?:[A-Z]{1,2}(?:[/>][A-Z]{1,2})?|world|start))*"
)


class FrameParts(NamedTuple):
    """A frame taken apart for its text.

    Attributes:
        base: that most coordinates of the place follow.
        code: of whether axes and rotation are the base's own.
        toward: the key of the object that these axes point to; empty where they are the object's.
        along: what else single coordinates (0 to 2) follow.
        axes, hand: what these follow where it is neither the world nor the base.
    """

    base: Source
    code: str
    toward: str
    along: Mapping[int, Source]
    axes: Source | None
    hand: Source | None

    @classmethod
    def of(cls, frame: Frame) -> "FrameParts":
        """Take a frame apart."""
        base = Counter(frame.place).most_common(1)[0][0]
        along = {axis: source for axis, source in enumerate(frame.place) if source != base}
        own = [source for source in (frame.axes, frame.hand) if _is_own(source, base)][:1]
        place, hand = ("o" if [source] == own else "w" for source in (frame.axes, frame.hand))
        return cls(
            base,
            base.kind if base.kind in ("world", "start") else place if place == hand else place + hand,
            own[0].other if own else "",
            along,
            None if [frame.axes] == own or frame.axes == WORLD else frame.axes,
            None if [frame.hand] == own or frame.hand == WORLD else frame.hand,
        )

    @property
    def is_of_several(self) -> bool:
        """Whether the place follows more than one object, or an object and the world."""
        return bool(self.along or self.toward or self.axes is not None or self.base.kind == "between")

    def text(self, letters: Mapping[str, str]) -> str:
        """Return the text with these letters for keys of objects."""
        at = f"{self.at(letters)} " if self.base.objects else ""
        return f"{at}{self.code}{self.others(letters)}"

    def at(self, letters: Mapping[str, str]) -> str:
        """Return the text of the base."""
        return _text(self.base, letters)

    def others(self, letters: Mapping[str, str]) -> str:
        """Return the text of what else it follows."""
        toward = f">{letters[self.toward]}" if self.toward else ""
        others = {XYZ[axis]: source for axis, source in self.along.items()}
        others |= {name: source for name, source in (("axes", self.axes), ("hand", self.hand)) if source is not None}
        return toward + "".join(f" {name}={_text(source, letters)}" for name, source in others.items())


def frame_text(frame: Frame, letters: Mapping[str, str]) -> str | None:
    """Return the text of a frame; None where a scene lacks one of its objects."""
    return FrameParts.of(frame).text(letters) if frame.objects <= letters.keys() else None


def _is_own(axes: Source, base: Source) -> bool:
    return base.kind == "object" and axes.kind in ("object", "leaning", "toward") and axes.one == base.one


def _text(source: Source, letters: Mapping[str, str]) -> str:
    between = {"toward": ">", "between": "/"}.get(source.kind, "")
    return between.join(letters[key] for key in source.objects) or source.kind
