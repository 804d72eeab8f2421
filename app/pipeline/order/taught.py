"""The words of a task: object names, aliases, and its taught instructions as frames."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import islice, permutations

from app.pipeline.order.frames import Frame, frames_of, taught_verb
from app.pipeline.order.lexicon import Lexicon, noun_of, phrase_of
from app.pipeline.order.order import Grounding, Order, clause_of, clause_texts, mentions_in
from app.pipeline.order.sequence import needs_full_hand
from app.pipeline.order.vocabulary import PLACE_ADJECTIVES
from app.pipeline.order.words import IsWord

MAX_CHOICES = 200  # instructions that a model can be asked to choose from


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

    def order(self, text: str, phrases: Sequence[Grounding], unfamiliar: str | None = None) -> Order:
        """Return a canonical text about these objects as an `Order`."""
        return Order(text, self.names, tuple(phrases), unfamiliar)

    def literal(self, instruction: str) -> Order | None:
        """Return the instruction as it stands if it is a taught one, with the same or other objects; otherwise None."""
        whole, parts = self._forms
        clauses = [clause_of(text, self.names) for text in clause_texts(instruction)]
        named = [name for clause in clauses for name in clause.objects]
        apart = len(set(named)) == len(named)  # else what was taken elsewhere may be wanted again
        alike = apart and all(clause.form in parts for clause in clauses)
        if alike and len(clauses) > 1:
            alike = not needs_full_hand([frame.clause for frame in frames_of(instruction, self.lexicon)])
        if not alike and clause_of(instruction, self.names).form not in whole:
            return None
        if instruction not in self.instructions and self._says_where_only(instruction):
            return None  # "turn left" has the form of "turn left tap"
        return self.order(instruction, self.mentioned(instruction))

    def mentioned(self, instruction: str) -> tuple[Grounding, ...]:
        """Return the phrases that are object names; the whole instruction where the task's only object is not named."""
        mentions = mentions_in(instruction, self.names)
        found = [Grounding(instruction[start:end], name, "name") for start, end, name in mentions]
        if not found and len(self.names) == 1:
            return (Grounding(instruction, self.names[0], "taught"),)
        return tuple(found)

    @cached_property
    def choices(self) -> tuple[str, ...]:
        """The instructions that an unclear one may mean: the taught ones, and the same with other objects."""
        found = dict.fromkeys(self.instructions)
        for text in islice(self._about_others(), MAX_CHOICES):
            if len(found) < MAX_CHOICES and self.literal(text) is not None:
                found.setdefault(text)
        return tuple(found)

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """A frame for each clause of the taught instructions."""
        return tuple(frame for text in self.instructions for frame in frames_of(text, self.lexicon))

    @cached_property
    def fixed_words(self) -> frozenset[str]:
        """The words of taught clauses besides verb and objects, with their prepositions' roles as "role:"."""
        said = [phrase for frame in self.frames for phrase in frame.clause.fixed]
        return frozenset(word for phrase in said for word in (f"{phrase.role}:", *phrase.words))

    @cached_property
    def verbs(self) -> frozenset[str]:
        """The first words of taught clauses, unless they are words of objects."""
        first = frozenset(taught_verb(frame.text, self.lexicon) for frame in self.frames)
        return first - self.lexicon.objects_of.keys()

    def _about_others(self) -> Iterator[str]:
        for frame in self.frames:
            mine = tuple(dict.fromkeys(mention.name for mention in frame.named))
            for others in permutations(self.names, len(mine)) if frame.may_stand_alone else ():
                if (text := frame.text_for(dict(zip(mine, others, strict=True)), self.names)) is not None:
                    yield text

    @cached_property
    def _forms(self) -> tuple[frozenset[str], frozenset[str]]:
        """The forms of whole taught instructions, and of clauses that may stand alone."""
        whole = frozenset(clause_of(text, self.names).form for text in self.instructions)
        parts = [{clause_of(part, self.names).form for part in clause_texts(text)} for text in self.instructions]
        return whole, frozenset(part for each in parts if len(each) == 1 for part in each)

    def _says_where_only(self, instruction: str) -> bool:
        """Return whether a word of place names an object without its noun, so that it may be a direction instead."""
        said = {word.text for word in self.lexicon.read(instruction)}
        return any(
            instruction[start:end].lower() in PLACE_ADJECTIVES and noun_of(phrase_of(name)) not in said
            for start, end, name in mentions_in(instruction, self.names)
        )
