"""What a task was taught: object names, aliases, and its instructions.

A new instruction must be a taught one word for word, perhaps with other objects, or English words that fill the frames
of the taught English ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

from app.pipeline.order.clause_parser import Accepted
from app.pipeline.order.frames import Compound, Frame, frames_of, taught_verbs
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.order import Grounding, Order, template_of

MAX_KEPT = 256  # vocabularies: one of 100 instructions takes 1 MB


class TaughtWords:
    """The vocabulary and taught instructions that new instructions are parsed against. Built once per task version.

    Args:
        names: of the task's objects.
        aliases: other names, by object.
        instructions: of the demonstrations.
    """

    def __init__(self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], instructions: Sequence[str]) -> None:
        self.names = tuple(names)
        self.aliases = {name: tuple(words) for name, words in aliases.items()}
        self.instructions = tuple(dict.fromkeys(instructions))
        self.lexicon = Lexicon(self.names, self.aliases, self.instructions)

    def literal(self, instruction: str) -> Order | None:
        """Return the instruction as it stands if it is a taught one but for whole names of objects; otherwise None.

        Differences of case, of Unicode form and in the width of spaces do not count.
        """
        asked = Order(instruction, self.names)
        if (template_of(instruction, self.names), asked.form) not in self._templates:
            return None
        return replace(asked, phrases=self.named_in(asked))

    def named_in(self, said: Order) -> tuple[Grounding, ...]:
        """Return the phrases that are object names; the whole text where the task's only object is not named."""
        if not said.objects and len(self.names) == 1:
            return (Grounding(said.text, self.names[0], "taught"),)
        return tuple(Grounding(said.text[start:end], name, "name") for start, end, name in said.mentions)

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

    @cached_property
    def _templates(self) -> frozenset[tuple[str, str]]:
        return frozenset((template_of(text, self.names), Order(text, self.names).form) for text in self.instructions)


@lru_cache(MAX_KEPT)
def taught_words(
    names: tuple[str, ...], aliases: tuple[tuple[str, tuple[str, ...]], ...], instructions: tuple[str, ...]
) -> TaughtWords:
    """Return what instructions about these objects are parsed against; cached, because robots repeat themselves."""
    return TaughtWords(names, dict(aliases), instructions)
