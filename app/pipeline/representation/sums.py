"""The paper's rows with each number that follows an object written as a sum: what a small model misses is written out.

::

    {'drawer': [60,51,6,18] a(+0 +11 +6), 'open the drawer'}>open the drawer
    [1 open drawer a +0 +11 +6: [60+0=60,51+11=62,6+6=12,18+0=18]; 2 closed drawer +0 +0 +0: [60+0=60,51+0=51,...]]

(on one line). The reply repeats the instruction first: small models then read which object it names. A row has what
the gripper is, the object that it follows, the difference to that in bins, and the paper's bins but for rotations that
all demonstrated rows share, which objects do not have either. Those that follow the object are sums, of which the
results count; a yaw may leave 0..71 and is read modulo 72. A difference that turns with the object, or that binning
changes from scene to scene, is a step: it has a letter, and the observation lists it beside the object. The grammar
holds each row to a difference that demonstrations show; which, of which object, and its sums are the model's.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar, NamedTuple

from app.pipeline.episode import Demonstration, Query
from app.pipeline.errors import ReplyParseError
from app.pipeline.order.order import Order
from app.pipeline.representation.absolute import AbsoluteCodec, Column, row_integers
from app.pipeline.representation.base import Codec, Decoder, row_count_bounds
from app.pipeline.representation.frame_text import FrameParts
from app.pipeline.representation.object_frame import ObjectFrameCodec
from app.pipeline.representation.object_rows import RelativePose, TextRow, actions_at, letter
from app.pipeline.skill.scene import START, WORLD, Scene, Source
from app.pipeline.skill.shown import Shown
from app.pipeline.workspace import ROTATION_BINS, Workspace, discretize_actions, object_bins, undiscretize_actions
from roboprompt_client.types.poses import EndEffectorAction

NO_TURN = ROTATION_BINS // 2  # the bin of an angle of 0
_ROW = re.compile(r"[^\];]+\]")
_WHOLE_ROW = r"[^\[\];]+: \[[^\[\]]*\]"
_REPLY = re.compile(rf"[^\n\[]*\[{_WHOLE_ROW}(?:; {_WHOLE_ROW})*\]\s*")
_ADDENDS = re.compile(r"\d+[+-]\d+=")
_GRIPPER = re.compile(r"(?:^|\[)\d+ (open|closed) ")
_RULES = """gripper ::= "open " | "closed "
p ::= [0-9] | [1-9] [0-9]
r ::= [0-9] | [1-6] [0-9] | "7" [01]
t ::= "-"? ("1"? [0-9] [0-9] | [0-9])
"""


class _Followed(NamedTuple):
    """What a row follows in a scene, and how, in bins.

    Attributes:
        text: its name in rows: `drawer z=world`, `plate/cup`.
        step: the letter of the step that the row is; empty if it is none.
        origin: the bins of what it follows, in a place between two objects of the first; none of the world.
        differences: of the row's six bins to these; None where a number does not follow.
    """

    text: str
    step: str
    origin: Sequence[int]
    differences: tuple[int | None, ...]

    def before_results(self, columns: Sequence[int]) -> Iterator[str]:
        """What the row says before the result in each of these columns: `drawer a +0 +11 +6: [60+0=`, `,51+11=`, ..."""
        head = (self.text, self.step, *(f"{by:+d}" for by in self.differences[:3] if by is not None))
        before = f"{' '.join(filter(None, head))}: ["
        for k in columns:
            yield before if (by := self.differences[k]) is None else f"{before}{self.origin[k]}{by:+d}="
            before = ","


@dataclass(frozen=True, eq=False)
class SumsCodec(Codec):
    """Absolute rows as sums, fitted to the demonstrations of one prompt.

    Attributes:
        fitted: the demonstrations relative to objects: what each row follows, and at what difference.
    """

    workspace: Workspace
    fitted: ObjectFrameCodec
    stop: ClassVar[tuple[str, ...]] = ("\n",)
    separator: ClassVar[str] = "\n"
    columns: ClassVar[Sequence[Column]] = (
        *AbsoluteCodec.columns[:5],
        Column("yaw", -NO_TURN, ROTATION_BINS + NO_TURN - 1),
    )

    @classmethod
    def of(cls, shown: Sequence[Shown], workspace: Workspace) -> "SumsCodec":
        """Write the rows of demonstrations."""
        return cls(workspace, ObjectFrameCodec.of(shown, workspace, with_instruction=True))

    @cached_property
    def _rows(self) -> list[tuple[Demonstration, TextRow]]:
        """All rows, each with its demonstration."""
        table = zip(self.fitted.demonstrations, self.fitted.table, strict=True)
        return [(demonstration, row) for demonstration, rows in table for row in rows]

    @cached_property
    def _letters(self) -> dict[TextRow, str]:
        """The letter of each step that observations list: of a row at differences that vary from scene to scene."""
        steps = [row for row, scenes in self._scenes.items() if self._is_step(row, scenes)]
        return {step: letter(number).lower() for number, step in enumerate(steps)}

    @cached_property
    def _scenes(self) -> dict[TextRow, list[Demonstration]]:
        """The demonstrations that have each row."""
        scenes: dict[TextRow, list[Demonstration]] = {}
        for demonstration, row in self._rows:
            scenes.setdefault(row, []).append(demonstration)
        return scenes

    def _is_step(self, row: TextRow, scenes: Sequence[Demonstration]) -> bool:
        parts = FrameParts.of(row.frame)
        if parts.base == WORLD:
            return False
        turns = row.frame.axes != WORLD and any(row.numbers[:2])
        apart = {self._followed(item, row).differences[:3] for item in scenes}
        return turns or row.frame.hand.kind == "leaning" or parts.is_of_several or len(apart) > 1

    @cached_property
    def _shared(self) -> dict[int, int]:
        """The rotation bins, by column, that are equal in all rows and follow no object."""
        placed = [self._placed(*each) for each in self._rows]
        turning = {row.frame.hand.kind for _, row in self._rows if row.frame.hand != WORLD}
        fixed = () if turning & {"leaning", "start"} else (3, 4) if turning else (3, 4, 5)
        return {k: placed[0][k] for k in fixed if len({bins[k] for bins in placed}) == 1}

    @cached_property
    def _shown(self) -> tuple[int, ...]:
        """The columns of the six bins that rows and objects show."""
        return tuple(k for k in range(6) if k not in self._shared)

    def needed(self) -> tuple[Demonstration, ...]:
        return self.fitted.needed()

    def questions(self, order: Order) -> tuple[str, ...]:
        return self.fitted.questions(order)

    def observation_text(self, query: Query) -> str:
        parts = [
            f"'{name}': [{','.join(str(bins[k]) for k in self._shown if k < len(bins))}]{self._steps_text(query, name)}"
            for name, bins in self._origins(query).items()
        ]
        return "{" + ", ".join([*parts, f"'{query.instruction}'"]) + "}>"

    def _steps_text(self, query: Query, name: str) -> str:
        """The steps at an object (or the start) as a scene's observation lists them."""
        texts = []
        for row, step in self._steps_at(query, name):
            numbers = [f"{by:+d}" for by in self._followed(query, row).differences[:3] if by is not None]
            if row.frame.hand.kind == "leaning":
                numbers += [str(self._placed(query, row)[k]) for k in self._shown[3:]]
            texts.append(f" {step}({' '.join(numbers)})")
        return "".join(texts)

    def _steps_at(self, query: Query, name: str) -> Iterator[tuple[TextRow, str]]:
        """Yield the rows that steps are where the query's order is carried out and they follow `name`, with letters."""
        names = _names(query)
        for row, text in self._letters.items():
            same = self._scenes[row][0].order.form == query.order.form and row.frame.objects <= names.keys()
            if same and self._origin_name(row, names) == name:
                yield row, text

    def _origin_name(self, row: TextRow, names: Mapping[str, str]) -> str:
        """Return the name of what differences are to: of a place between two objects, the first."""
        base = FrameParts.of(row.frame).base
        return names[base.one] if base.one else base.kind

    def actions_text(self, demonstration: Demonstration) -> str:
        rows = self.fitted.table[self.fitted.demonstrations.index(demonstration)]
        texts = [f"{number} {self._row_text(demonstration, row)}" for number, row in enumerate(rows, start=1)]
        return f"{demonstration.instruction} [{'; '.join(texts)}]"

    def _row_text(self, demonstration: Demonstration, row: TextRow) -> str:
        followed = self._followed(demonstration, row, self._letters.get(row, ""))
        origin, by, placed = followed.origin, followed.differences, self._placed(demonstration, row)
        results = (placed[k] if (off := by[k]) is None else origin[k] + off for k in self._shown)
        before = followed.before_results(self._shown)
        cells = "".join(f"{text}{result}" for text, result in zip(before, results, strict=True))
        return f"{'open' if row.gripper_open else 'closed'} {cells}]"

    def _origins(self, query: Query) -> dict[str, tuple[int, ...]]:
        """The bins of everything that a row may follow, by name: of objects, and of the start where rows follow it."""
        origins = {pose.name: object_bins(pose, self.workspace) for pose in query.objects}
        if query.start is not None and any(START in row.frame.place for _, row in self._rows):
            origins[START.kind] = discretize_actions([query.start], self.workspace)[0].bins[:6]
        return origins

    def _placed(self, query: Query, row: TextRow) -> tuple[int, ...]:
        """The six bins of a row in a scene."""
        pose = RelativePose.of_numbers(row.numbers)
        actions = actions_at([row.frame], [pose], [row.gripper_open], Scene.of(query))
        return discretize_actions(actions, self.workspace)[0].bins[:6]

    def _followed(self, query: Query, row: TextRow, step: str = "") -> _Followed:
        """What a row follows in a scene."""
        parts, names = FrameParts.of(row.frame), _names(query)
        if parts.base == WORLD:
            return _Followed(WORLD.kind, step, (), (None,) * 6)
        origins, placed = self._origins(query), self._placed(query, row)
        origin = list(origins[self._origin_name(row, names)])
        turns = row.frame.hand == Source("object", parts.base.one)
        turn = row.numbers[5] - NO_TURN if turns else None
        for axis, source in parts.along.items():
            origin[axis] = origins[names[source.one]][axis] if source.one else 0
        fixed = {axis for axis, source in parts.along.items() if source == WORLD}
        differences = (*(None if k in fixed else placed[k] - origin[k] for k in range(3)), None, None, turn)
        return _Followed(f"{parts.at(names)}{parts.others(names)}", step, origin, differences)

    def grammar(self, query: Query, max_actions: int) -> str:
        fewest, most = row_count_bounds(self.fitted.demonstrations, query.order, max_actions)
        more = "".join(
            f" {'(' if number > fewest else ''}{_literal(f'; {number} ')} row" for number in range(2, most + 1)
        )
        row = " | ".join(dict.fromkeys(self._rows_offered(query)))
        return (
            f'root ::= {_literal(f"{query.instruction} [1 ")} row{more}{")?" * (most - fewest)} "]"\n'
            f'row ::= gripper ({row}) "]"\n{_RULES}'
        )

    def _rows_offered(self, query: Query) -> Iterator[str]:
        """Yield in GBNF what a row may say after its gripper: each step at its object, any other difference at all."""
        for name, origin in (self._origins(query) | {WORLD.kind: ()}).items():
            said = [self._followed(query, row, step) for row, step in self._steps_at(query, name)]
            said += [
                _Followed(name, "", origin, by) for by in self._without_step if (by[0] is None) == (name == WORLD.kind)
            ]
            for followed in said:
                turn = followed.differences[5] if len(followed.origin) == 6 else None
                before = followed._replace(differences=(*followed.differences[:5], turn)).before_results(self._shown)
                rules = ("p" if k < 3 else "r" if turn is None or k < 5 else "t" for k in self._shown)
                yield " ".join(f"{_literal(text)} {rule}" for text, rule in zip(before, rules, strict=True))

    @cached_property
    def _without_step(self) -> dict[tuple[int | None, ...], None]:
        """The differences of the rows that are no steps; a row with several origins is one wherever all have it."""
        rows = ((item, row) for item, row in self._rows if row not in self._letters)
        return dict.fromkeys(self._followed(*each).differences for each in rows)

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        """The rows; the first has what stands before it, so that `reply_text` gives it back."""
        if complete and not _REPLY.fullmatch(reply_text):
            raise ReplyParseError("the reply is not one list '[1 open drawer: [60+0=60, ...]; ...]'", reply_text)
        return [row.strip() for row in _ROW.findall(reply_text)]

    def reply_text(self, rows: Sequence[str]) -> str:
        return f"{'; '.join(rows)}]"

    def decoder(self, query: Query) -> Decoder:
        return partial(self._actions, query.instruction)

    def _actions(self, instruction: str, first: int, rows: Sequence[str]) -> list[EndEffectorAction]:
        bins = [self._bins(row, index, instruction) for index, row in enumerate(rows, start=first)]
        return undiscretize_actions(bins, self.workspace)

    def _bins(self, row: str, index: int, instruction: str) -> tuple[int, ...]:
        """Read a row. Before the first the instruction may stand: after other words it may be a draft."""
        gripper = _GRIPPER.search(row)
        if gripper is None or row[: gripper.start()].strip() not in ("", instruction if index == 0 else ""):
            raise ReplyParseError(f"action {index} does not begin with its number and 'open' or 'closed'", row)
        columns = [self.columns[k] for k in self._shown]
        numbers = row_integers(_ADDENDS.sub("", row[row.rindex("[") :]), index, columns)
        bins = self._shared | dict(zip(self._shown, numbers, strict=True))
        return (*(bins[k] for k in range(5)), bins[5] % ROTATION_BINS, int(gripper[1] == "open"))


def _literal(text: str) -> str:
    """The text as a literal of GBNF."""
    escaped = re.sub(r'(["\\])', r"\\\1", text)
    return f'"{escaped}"'


def _names(query: Query) -> dict[str, str]:
    """Return the names of a scene's objects by their keys."""
    return {query.order.placeholder(pose.name): pose.name for pose in query.objects}
