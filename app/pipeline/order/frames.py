"""Taught instructions as patterns: each clause a frame, and each sequence of clauses a compound.

A frame is a parsed clause whose objects can be replaced: "put the mug on the plate" is a frame for "put the bowl on the
plate". The clauses of a compound ("put the mug in the drawer and close it") are asked for together, in their order.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, SOURCE, ParsedClause, fits
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import Clause, Mention, Order
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.verbs import PICKING
from app.pipeline.order.vocabulary import DETERMINERS, SHORT_PREPOSITIONS

JOINTS = frozenset({"and", ",", "then"})
THING_FOLLOWS = DETERMINERS | {"it", "them"}


@dataclass(frozen=True, eq=False)
class Pattern:
    """A taught text whose objects can be replaced.

    Attributes:
        text: as it was taught.
        named: the places in the text that name objects.
    """

    text: str
    named: tuple[Mention, ...]

    def text_for(self, filled: Mapping[str, str], names: Sequence[str]) -> str:
        """Return the taught text with other objects; empty if it would then not mention them in the same order."""
        if any(filled.get(name, name) != name for name in self._scattered):
            return ""
        wanted = tuple(filled[name] for name in Order(self.text, tuple(names)).objects if name in filled)
        for whole in (False, True):
            text = self.text
            for start, end, name in reversed(self.named):
                if filled.get(name, name) != name:
                    text = text[:start] + _called(filled[name], text[start:end], name, names, whole) + text[end:]
            if Order(text, tuple(names)).objects == wanted:
                return text
        return ""

    @cached_property
    def _scattered(self) -> frozenset[str]:
        """The objects named by separate words, which no other name can replace: "pour water from the bottle"."""
        mentions = zip(self.named, self.named[1:], strict=False)
        return frozenset(
            one.name for one, next_ in mentions if one.name == next_.name and self.text[one.end : next_.start].strip()
        )


@dataclass(frozen=True, eq=False)
class Frame(Pattern):
    """One clause of a taught instruction.

    Attributes:
        clause: as it was parsed.
        may_stand_alone: whether its instruction consists of this clause alone, once or repeated after "then".
    """

    clause: ParsedClause
    may_stand_alone: bool

    def filled(self, clause: ParsedClause, names: Sequence[str]) -> Mapping[str, str] | None:
        """Return the object of `clause` for each object of the frame; None if the clause asks for something else."""
        one_destination = self._one_destination(clause)
        if one_destination is None or not fits(
            clause.fixed_phrases, self.clause.fixed_phrases, has_destination=clause.has_destination
        ):
            return None
        asked, taught = (
            {"to" if one_destination and role in ("in", "on") else role: phrases for role, phrases in each.roles}
            for each in (clause, self.clause)
        )
        if len(asked) < len(clause.roles):
            return None  # two destinations: "push the block to the wall in the box"
        if len(names) == 1 and not (set(asked) | set(taught)) - {DIRECT}:
            return self._of_the_only(clause, names[0])
        # "wipe the table": with what it was taught with; "take the lid" alone says nothing of where it lies
        for role in (INSTRUMENT,) if clause.verb in PICKING else (INSTRUMENT, SOURCE):
            if role in taught and asked:
                asked.setdefault(role, taught[role])
        if {role: len(phrases) for role, phrases in taught.items()} != {r: len(p) for r, p in asked.items()}:
            return None
        pairs = [pair for role in taught for pair in zip(taught[role], asked[role], strict=True)]
        filled = {mine.name: other.name for mine, other in pairs if mine.name and other.name}
        replaceable = {mention.name for mention in self.named}
        is_clear = len(pairs) == len(filled) == len(set(filled.values()))
        return filled if is_clear and all(a in replaceable or a == b for a, b in filled.items()) else None

    def _one_destination(self, clause: ParsedClause) -> bool | None:
        """Return whether prepositions of destination are interchangeable; None if the verbs mean different actions.

        A clause without a verb takes the frame's.
        """
        same = clause.verb in (None, self.clause.verb)
        families = self.clause.families_with(self.clause.verb if same else clause.verb)
        return any(family.one_destination for family in families) if same or families else None

    def _of_the_only(self, clause: ParsedClause, name: str) -> Mapping[str, str] | None:
        """Return the match of a task with one object, which neither the taught nor the asked clause must name.

        None if a particle may refer to the robot instead: "turn around".
        """
        number = len(clause.objects_in(DIRECT))
        if not number and self.clause.objects_in(DIRECT):
            return None  # "stop" may be said to the robot where "stop the belt" was taught
        clear = number == 1 or clause.verb is None or " " not in clause.verb or clause.verb == self.clause.verb
        return {name: name} if number <= 1 and clear else None


@dataclass(frozen=True, eq=False)
class Compound(Pattern):
    """A taught instruction of several clauses.

    Attributes:
        frames: of its clauses; their text is that of the part between two "then".
    """

    frames: tuple[Frame, ...]

    def filled(self, clauses: Sequence[ParsedClause], names: Sequence[str]) -> list[Mapping[str, str]]:
        """Return for each clause the objects for those of its frame; none if the clauses ask for something else."""
        if len(clauses) != len(self.frames) or any(clause.verb is None for clause in clauses):
            return []  # "the mug and the box" does not say what to do
        each = [frame.filled(clause, names) for frame, clause in zip(self.frames, clauses, strict=True)]
        found = [filled for filled in each if filled is not None]
        pairs = {pair for filled in found for pair in filled.items()}
        is_one_to_one = len(pairs) == len({mine for mine, _ in pairs}) == len({other for _, other in pairs})
        return found if len(found) == len(each) and is_one_to_one else []

    def has(self, clauses: Sequence[ParsedClause], names: Sequence[str]) -> bool:
        """Return whether it has each of these clauses, with these or other objects, and more."""
        parts = [frame for frame in self.frames if not frame.may_stand_alone]
        found = (any(part.filled(clause, names) is not None for part in parts) for clause in clauses)
        return len(clauses) < len(self.frames) and all(found)


def _called(name: str, before: str, was: str, names: Sequence[str], whole: bool) -> str:
    """Return the words for object `name` in place of `before`, which named `was`: its name or distinctive word."""
    if "_" in before:
        return name
    others = {word for other in names if other != name for word in other.replace("_", " ").lower().split()}
    own = set(name.replace("_", " ").lower().split()) - others
    named_whole = before.lower() == was.replace("_", " ").lower()
    return name.replace("_", " ") if whole or named_whole or len(own) != 1 else own.pop()


def frames_of(instruction: str, lexicon: Lexicon) -> tuple[Frame, ...]:
    """Return the frames of a taught instruction's clauses; empty if it is not English or one of them has no parse.

    Raises:
        TooInvolvedError: naming the instruction, if its parse takes too many steps.
    """
    if not lexicon.is_english(instruction):
        return ()
    whole = Order(instruction, lexicon.names)
    parts = [(part, _parsed(part, lexicon)) for part in whole.clauses]
    if any(phrase.name is None for _, clauses in parts for clause in clauses for phrase in clause.phrases):
        text = Clause(instruction, whole.form, whole.objects)
        parts = [(text, _parsed(text, lexicon))]  # "put the mug in the drawer, then close it"
    if not all(clauses for _, clauses in parts):
        return ()
    signatures = {clause.signature for _, clauses in parts for clause in clauses}
    alone = len(signatures) == 1 and all(len(clauses) == 1 for _, clauses in parts)
    return tuple(
        Frame(part.text, Order(part.text, lexicon.names).mentions, clause, alone)
        for part, clauses in parts
        for clause in clauses
    )


def taught_verbs(texts: Iterable[str], lexicon: Lexicon) -> frozenset[str]:
    """Return the words that begin taught clauses, verbs even if no table lists them, unless they are words of objects.

    After "and" and the like, only a word before "the" or "it" certainly begins a clause: "put it down and wring it".
    """
    found = set[str]()
    for text in texts:
        words = [word.text for word in lexicon.read(text) if word.text != "please"]
        later = zip(words, words[1:], words[2:], strict=False)
        found |= {*words[:1], *(word for before, word, after in later if before in JOINTS and after in THING_FOLLOWS)}
    return frozenset(found) - lexicon.objects_of.keys() - SHORT_PREPOSITIONS


def _parsed(said: Clause, lexicon: Lexicon) -> tuple[ParsedClause, ...]:
    """Return the parse of a taught part with the fewest clauses and fixed words; none without one that has its objects.

    Several clauses are joined by "and" or a comma. A word without a role in one of them may be an unknown verb.
    """
    accepted = Accepted(taught_verbs([said.text], lexicon), fixed=None)
    sentences = Sentences(NounPhrases(said.text, lexicon, None), accepted)
    read = [form for forms in sentences.readings() for form in forms]
    objects = set(said.objects)
    fitting = [
        form
        for form in read
        if objects <= {phrase.name for clause in form for phrase in clause.phrases}
        and (len(form) == 1 or not any(phrase.is_loose for clause in form for phrase in clause.fixed))
    ]
    return min(fitting, key=lambda form: (len(form), [_unlikelihood(clause) for clause in form]), default=())


def _unlikelihood(clause: ParsedClause) -> tuple[bool, int, int]:
    words = sum(len(phrase.words) + bool(phrase.role) for phrase in clause.fixed_phrases)
    return clause.verb is None, words, -len(clause.verb or "")
