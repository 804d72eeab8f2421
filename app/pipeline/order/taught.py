"""What a task was taught: object names, aliases, and its instructions as frames, one of which a new one must fill."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice, permutations

from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.frames import Compound, Frame, frames_of, taught_verbs
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.order import Grounding, Order
from app.pipeline.order.vocabulary import PLACE_ADJECTIVES
from app.pipeline.order.words import IsWord, noun_of, phrase_of

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
        return tuple(frame for frames in self._frames_by_text.values() for frame in frames)

    @cached_property
    def compounds(self) -> tuple[Compound, ...]:
        """The taught instructions of several clauses."""
        return tuple(
            Compound(text, Order(text, self.names).mentions, frames)
            for text, frames in self._frames_by_text.items()
            if len(frames) > 1
        )

    @cached_property
    def _frames_by_text(self) -> dict[str, tuple[Frame, ...]]:
        return {text: frames_of(text, self.lexicon) for text in self.instructions}

    @cached_property
    def accepted(self) -> Accepted:
        """The verbs and fixed words of taught clauses."""
        said = [phrase for frame in self.frames for phrase in frame.clause.fixed]
        fixed = frozenset(word for phrase in said for word in (f"{phrase.role}:", *phrase.words))
        return Accepted(taught_verbs({frame.text for frame in self.frames}, self.lexicon), fixed)

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
