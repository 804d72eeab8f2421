"""Taught instructions as frames: a clause with places for objects, to be filled with others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from app.pipeline.order.clause_parser import DIRECT, ParsedClause
from app.pipeline.order.fixed_phrases import FixedPhrase, fits
from app.pipeline.order.lexicon import Lexicon
from app.pipeline.order.noun_phrases import NounPhrase, NounPhrases, TooInvolvedError
from app.pipeline.order.order import Mention, clause_of, clause_texts, mentions_in
from app.pipeline.order.sentences import Sentences
from app.pipeline.order.verbs import Family, common_families

INSTRUMENT = "with"  # the role that may be left out
Signature = tuple[str | None, tuple[tuple[str, int], ...], tuple[FixedPhrase, ...]]


@dataclass(frozen=True, eq=False)
class Frame:
    """One clause of a taught instruction.

    Attributes:
        text: as it was taught.
        clause: as it was read.
        named: where the text names objects so that prompts find them.
        plan: the signatures of all clauses of its instruction.
    """

    text: str
    clause: ParsedClause
    named: tuple[Mention, ...]
    plan: tuple[Signature, ...]

    @property
    def signature(self) -> Signature:
        """What it asks for, whatever the objects."""
        return signature_of(self.clause)

    @property
    def may_stand_alone(self) -> bool:
        """Whether its instruction asks for nothing but this, once or several times."""
        return set(self.plan) == {self.signature}

    def filled(self, clause: ParsedClause, names: Sequence[str]) -> Mapping[str, str] | None:
        """By the objects of the frame those that `clause` puts in their place; None if it asks for something else."""
        roles = dict(self.clause.roles)
        one_destination = _alike(clause, self.clause)
        if one_destination is None or not fits(clause.fixed_phrases, self.clause.fixed_phrases):
            return None
        asked = _roles(clause, one_destination)
        taught = {_plain(role, one_destination): phrases for role, phrases in roles.items()}
        if len(names) == 1 and not (set(asked) | set(taught)) - {DIRECT}:
            return self._of_the_only(clause, names[0])
        if INSTRUMENT in taught and INSTRUMENT not in asked:
            asked[INSTRUMENT] = taught[INSTRUMENT]  # "wipe the table": with what it was taught with
        if {role: len(phrases) for role, phrases in taught.items()} != {r: len(p) for r, p in asked.items()}:
            return None
        pairs = [pair for role in taught for pair in zip(taught[role], asked[role], strict=True)]
        return self._checked([(mine.name, other.name) for mine, other in pairs])

    def _of_the_only(self, clause: ParsedClause, name: str) -> Mapping[str, str] | None:
        """A task's only object need not be named, neither by what is taught nor by what is asked.

        A particle may then be about the robot: "turn around".
        """
        number = len(clause.objects_in(DIRECT))
        clear = number == 1 or clause.verb is None or " " not in clause.verb or clause.verb == self.clause.verb
        return {name: name} if number <= 1 and clear else None

    def _checked(self, pairs: Sequence[tuple[str | None, str | None]]) -> Mapping[str, str] | None:
        filled = {mine: other for mine, other in pairs if mine and other}
        replaceable = {mention.name for mention in self.named}
        if len(filled) < len(pairs) or len(set(filled.values())) < len(filled):
            return None
        return filled if all(mine in replaceable or mine == other for mine, other in filled.items()) else None

    def text_for(self, filled: Mapping[str, str], names: Sequence[str]) -> str | None:
        """The taught text with other objects; None if it would not name them in the order that they have."""
        if any(filled.get(name, name) != name for name in self._scattered):
            return None
        wanted = tuple(filled[name] for name in clause_of(self.text, tuple(names)).objects if name in filled)
        for whole in (False, True):
            text = self.text
            for start, end, name in reversed(self.named):
                if filled.get(name, name) != name:
                    text = text[:start] + _called(filled[name], text[start:end], name, names, whole) + text[end:]
            if clause_of(text, tuple(names)).objects == wanted:
                return text
        return None

    @cached_property
    def _scattered(self) -> frozenset[str]:
        """What is named by words apart, for which no other name can stand: "pour water from the bottle"."""
        mentions = zip(self.named, self.named[1:], strict=False)
        return frozenset(
            one.name for one, next_ in mentions if one.name == next_.name and self.text[one.end : next_.start].strip()
        )


def _called(name: str, before: str, was: str, names: Sequence[str], whole: bool) -> str:
    """What a text calls an object that stands where `was` was called `before`: its name, or the words of its own."""
    if "_" in before:
        return name
    spaced, distinctive = name.replace("_", " "), sorted(_own_words(name, names))
    named_whole = before.lower() == was.replace("_", " ").lower()
    return spaced if whole or named_whole or len(distinctive) != 1 else distinctive[0]


def _own_words(name: str, names: Sequence[str]) -> set[str]:
    others = {word for other in names if other != name for word in other.replace("_", " ").lower().split()}
    return set(name.replace("_", " ").lower().split()) - others


def signature_of(clause: ParsedClause) -> Signature:
    """Verb, number of objects in each role, and fixed phrases."""
    return clause.verb, tuple(sorted((role, len(phrases)) for role, phrases in clause.roles)), clause.fixed_phrases


def _alike(one: ParsedClause, other: ParsedClause) -> bool | None:
    """Whether two verbs ask for the same; None if not. True if their destinations may be put in any way.

    A clause without a verb leaves it to what is taught.
    """
    if one.verb is None or one.verb == other.verb:
        return any(family.one_destination for family in _families(other, other))
    families = _families(one, other)
    return any(family.one_destination for family in families) if families else None


def _families(one: ParsedClause, other: ParsedClause) -> list[Family]:
    roles = {role for role, _ in other.roles if role != DIRECT}
    return common_families(one.verb or "", other.verb or "", roles)


def _plain(role: str, one_destination: bool) -> str:
    return "to" if one_destination and role in ("in", "on") else role


def _roles(clause: ParsedClause, one_destination: bool) -> dict[str, tuple[NounPhrase, ...]]:
    return {_plain(role, one_destination): phrases for role, phrases in clause.roles}


def frames_of(instruction: str, lexicon: Lexicon) -> tuple[Frame, ...]:
    """The frames of a taught instruction's clauses; none if one of them is beyond this grammar."""
    texts = clause_texts(instruction)
    read = [_read(text, lexicon) for text in texts]
    if not all(read):
        return ()
    known = [clause for clause in read if clause]
    plan = tuple(map(signature_of, known))
    named = [mentions_in(text, lexicon.names) for text in texts]
    return tuple(Frame(*parts, plan) for parts in zip(texts, known, named, strict=True))


def taught_verb(text: str, lexicon: Lexicon) -> str:
    """The first word of a taught clause, which is taken for its verb even if no table has it."""
    words = [word for word in lexicon.read(text) if word.text != "please"]
    return words[0].text if words else ""


def _read(text: str, lexicon: Lexicon) -> ParsedClause | None:
    """The reading of a taught clause in which most words are understood."""
    own = frozenset({taught_verb(text, lexicon)} - lexicon.objects_of.keys())
    sentences = Sentences(NounPhrases(text, lexicon, None), None, own)
    try:
        read = [form[0] for forms in sentences.readings() for form in forms if len(form) == 1]
    except TooInvolvedError:
        return None
    mentioned = set(clause_of(text, lexicon.names).objects)
    fitting = [clause for clause in read if mentioned <= {phrase.name for phrase in clause.phrases}]
    return min(fitting, key=_unlikelihood, default=None)


def _unlikelihood(clause: ParsedClause) -> tuple[bool, int, int]:
    words = sum(len(phrase.words) + bool(phrase.role) for phrase in clause.fixed_phrases)
    return clause.verb is None, words, -len(clause.verb or "")
