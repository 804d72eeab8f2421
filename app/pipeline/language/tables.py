"""Tables of phrases that are looked up at every word of an instruction."""

from collections.abc import Iterable, Iterator, Sequence

Phrase = tuple[str, ...]


class PhraseTable:
    """A set of phrases, found by their first word."""

    def __init__(self, phrases: Iterable[Phrase]) -> None:
        self._by_first: dict[str, list[Phrase]] = {}
        for phrase in sorted(phrases, key=len, reverse=True):
            self._by_first.setdefault(phrase[0], []).append(phrase)

    def __iter__(self) -> Iterator[Phrase]:
        return (phrase for phrases in self._by_first.values() for phrase in phrases)

    def all_at(self, texts: Sequence[str], at: int) -> Iterator[Phrase]:
        """The phrases that stand there, the longest first."""
        if at < len(texts):
            for phrase in self._by_first.get(texts[at], ()):
                if len(phrase) == 1 or tuple(texts[at : at + len(phrase)]) == phrase:
                    yield phrase

    def end_at(self, texts: Sequence[str], at: int) -> int | None:
        """Where the longest phrase that stands there ends; None if none does."""
        phrase = next(self.all_at(texts, at), None)
        return None if phrase is None else at + len(phrase)


def phrases(text: str) -> PhraseTable:
    """The phrases that a text lists, with commas between them."""
    return PhraseTable(tuple(part.split()) for part in text.split(","))
