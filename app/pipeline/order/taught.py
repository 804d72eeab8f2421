"""What a task was taught: object names, aliases, and each clause of its instructions as a frame.

A frame is a parsed clause whose objects can be replaced: "put the mug on the plate" is a frame for "put the bowl on the
plate". A new instruction must fill one of them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, permutations

from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.clauses import DIRECT, INSTRUMENT, SOURCE, ParsedClause, Signature, fits
from app.pipeline.order.lexicon import Lexicon, TooInvolvedError
from app.pipeline.order.noun_phrases import NounPhrases
from app.pipeline.order.order import Clause, Grounding, Mention, Order
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.verbs import PICKING
from app.pipeline.order.vocabulary import PLACE_ADJECTIVES
from app.pipeline.order.words import IsWord, noun_of, phrase_of

MAX_CHOICES = 200  # instructions that a model can be asked to choose from


@dataclass(frozen=True, eq=False)
class Frame:
    """One clause of a taught instruction whose objects can be replaced.

    Attributes:
        text: as it was taught.
        clause: as it was parsed.
        named: the places in the text that name objects.
        plan: the signatures of all clauses of its instruction.
    """

    text: str
    clause: ParsedClause
    named: tuple[Mention, ...]
    plan: tuple[Signature, ...]

    @property
    def may_stand_alone(self) -> bool:
        """Whether its instruction consists of this clause alone, once or repeated."""
        return set(self.plan) == {self.clause.signature}

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


def _called(name: str, before: str, was: str, names: Sequence[str], whole: bool) -> str:
    """Return the words for object `name` in place of `before`, which named `was`: its name or distinctive word."""
    if "_" in before:
        return name
    others = {word for other in names if other != name for word in other.replace("_", " ").lower().split()}
    own = set(name.replace("_", " ").lower().split()) - others
    named_whole = before.lower() == was.replace("_", " ").lower()
    return name.replace("_", " ") if whole or named_whole or len(own) != 1 else own.pop()


def frames_of(instruction: str, lexicon: Lexicon) -> tuple[Frame, ...]:
    """Return the frames of a taught instruction's clauses; empty if the grammar does not parse one of them."""
    said = Order(instruction, lexicon.names).clauses
    parsed = [clause for each in said if (clause := _parsed(each, lexicon)) is not None]
    if len(parsed) < len(said):
        return ()
    plan = tuple(clause.signature for clause in parsed)
    return tuple(
        Frame(each.text, clause, Order(each.text, lexicon.names).mentions, plan)
        for each, clause in zip(said, parsed, strict=True)
    )


def taught_verbs(texts: Iterable[str], lexicon: Lexicon) -> frozenset[str]:
    """Return the first words of taught clauses, verbs even if no table lists them, unless they are words of objects."""
    read = ([word.text for word in lexicon.read(text) if word.text != "please"] for text in texts)
    return frozenset(words[0] for words in read if words) - lexicon.objects_of.keys()


def _parsed(said: Clause, lexicon: Lexicon) -> ParsedClause | None:
    """Return the parse of a taught clause with the fewest fixed words; None without a parse that has its objects."""
    accepted = Accepted(taught_verbs([said.text], lexicon), fixed=None)
    sentences = Sentences(NounPhrases(said.text, lexicon, None), accepted)
    try:
        read = [form[0] for forms in sentences.readings() for form in forms if len(form) == 1]
    except TooInvolvedError:
        return None
    fitting = [clause for clause in read if set(said.objects) <= {phrase.name for phrase in clause.phrases}]
    return min(fitting, key=_unlikelihood, default=None)


def _unlikelihood(clause: ParsedClause) -> tuple[bool, int, int]:
    words = sum(len(phrase.words) + bool(phrase.role) for phrase in clause.fixed_phrases)
    return clause.verb is None, words, -len(clause.verb or "")


class TaughtWords:
    """The vocabulary and taught instructions that new instructions are parsed against. Built once per task version.

    Args:
        names: of the task's objects.
        aliases: other names, by object.
        instructions: of the demonstrations.
        is_word: whether a word is English; an English word is never corrected to another one.
    """

    def __init__(
        self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], instructions: Sequence[str], is_word: IsWord
    ) -> None:
        self.names = tuple(names)
        self.aliases = {name: tuple(words) for name, words in aliases.items()}
        self.instructions = tuple(dict.fromkeys(instructions))
        self.lexicon = Lexicon(self.names, self.aliases, self.instructions, is_word)

    def literal(self, instruction: str) -> Order | None:
        """Return the instruction as it stands if it is a taught one, with the same or other objects; otherwise None."""
        asked = Order(instruction, self.names)
        if asked.form not in self._forms:
            return None
        if instruction not in self.instructions and self._says_where_only(asked):
            return None  # "turn left" has the form of "turn left tap"
        return replace(asked, phrases=self.named_in(asked))

    def named_in(self, said: Order) -> tuple[Grounding, ...]:
        """Return the phrases that are object names; the whole text where the task's only object is not named."""
        if not said.mentions and len(self.names) == 1:
            return (Grounding(said.text, self.names[0], "taught"),)
        return tuple(Grounding(said.text[start:end], name, "name") for start, end, name in said.mentions)

    @cached_property
    def choices(self) -> tuple[str, ...]:
        """The instructions that an unclear one may mean: the taught ones, and the same with other objects."""
        others = filter(self.literal, islice(self._about_others(), MAX_CHOICES))
        return tuple(dict.fromkeys((*self.instructions, *others)))[: max(MAX_CHOICES, len(self.instructions))]

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """A frame for each clause of the taught instructions."""
        return tuple(frame for text in self.instructions for frame in frames_of(text, self.lexicon))

    @cached_property
    def accepted(self) -> Accepted:
        """The verbs and fixed words of taught clauses."""
        said = [phrase for frame in self.frames for phrase in frame.clause.fixed]
        fixed = frozenset(word for phrase in said for word in (f"{phrase.role}:", *phrase.words))
        return Accepted(taught_verbs((frame.text for frame in self.frames), self.lexicon), fixed)

    def _about_others(self) -> Iterator[str]:
        for frame in self.frames:
            mine = tuple(dict.fromkeys(mention.name for mention in frame.named))
            for others in permutations(self.names, len(mine)) if frame.may_stand_alone else ():
                if text := frame.text_for(dict(zip(mine, others, strict=True)), self.names):
                    yield text

    @cached_property
    def _forms(self) -> frozenset[str]:
        """The forms of whole taught instructions, and of clauses that may stand alone."""
        orders = [Order(text, self.names) for text in self.instructions]
        clauses = [{clause.form for clause in order.clauses} for order in orders]
        return frozenset(order.form for order in orders).union(*(forms for forms in clauses if len(forms) == 1))

    def _says_where_only(self, asked: Order) -> bool:
        """Return whether a word of place names an object without its noun, so that it may be a direction instead."""
        words = {word.text for word in self.lexicon.read(asked.text)}
        return any(
            asked.text[start:end].lower() in PLACE_ADJECTIVES and noun_of(phrase_of(name)) not in words
            for start, end, name in asked.mentions
        )
