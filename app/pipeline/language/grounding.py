"""Instructions are grounded: every word finds its place in what a task was taught, or the instruction is refused."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, permutations, product

from app.pipeline.errors import UnfamiliarInstructionError
from app.pipeline.language.clause_parser import DIRECT, Clause
from app.pipeline.language.descriptions import MEANS
from app.pipeline.language.frames import INSTRUMENT, Frame, frames_of, taught_verb
from app.pipeline.language.grammar import PLACE_ADJECTIVES
from app.pipeline.language.grounded import Grounded, Grounding
from app.pipeline.language.lexicon import Lexicon, noun_of, phrase_of
from app.pipeline.language.mentions import clauses, mention_order, mentions, template
from app.pipeline.language.phrases import NounPhrase, NounPhrases, TooInvolvedError
from app.pipeline.language.refusals import check_named, passed_on, refusal
from app.pipeline.language.sentences import PICKING, Sentences
from app.pipeline.language.space import Layout
from app.pipeline.language.verbs import DESTINATIONS
from app.pipeline.language.words import IsWord, Word

MAX_READINGS = 64  # that are compared; who needs more is ambiguous
MAX_CHOICES = 200  # instructions that a model can be asked to choose from
_JOINT = ", then "


@dataclass(frozen=True)
class _Filled:
    """A clause as a frame has it."""

    frame: Frame
    objects: Mapping[str, str]
    clause: Clause

    @property
    def is_as_taught(self) -> bool:
        return all(mine == other for mine, other in self.objects.items())


class Taught:
    """What a task was taught: its objects, what they are called, and its instructions. Made once per task version.

    Args:
        names: the task's objects.
        aliases: by object what else it is called.
        instructions: those that the demonstrations carry out.
        is_word: whether a word is English; such a word is never taken for a misspelt other.
    """

    def __init__(
        self, names: Sequence[str], aliases: Mapping[str, Sequence[str]], instructions: Sequence[str], is_word: IsWord
    ) -> None:
        self.names = tuple(names)
        self.aliases = {name: tuple(words) for name, words in aliases.items()}
        self.instructions = tuple(dict.fromkeys(instructions))
        self._is_word = is_word

    def ground(self, instruction: str, layout: Layout | None = None, *, allow_unfamiliar: bool = False) -> Grounded:
        """The instruction as it is understood.

        Args:
            layout: where the objects are, for relations.
            allow_unfamiliar: let pass what is unlike every taught instruction, if its objects are clear.

        Raises:
            UngroundedInstructionError: if a phrase stands for no object or for several.
            UnfamiliarInstructionError: if it is unlike every taught instruction, or has words that nothing explains.
        """
        if (literal := self._literal(instruction)) is not None:
            return literal
        words = self._lexicon.read(instruction)
        phrases = NounPhrases(words, self._lexicon, layout)
        found = self._understood(instruction, words, phrases)
        if len(found) == 1:
            return found[0]
        error = refusal(self, instruction, words, phrases, [each.instruction for each in found])
        if not allow_unfamiliar or not isinstance(error, UnfamiliarInstructionError):
            error.choices = self.choices
            raise error
        text, named = passed_on(self, instruction, words, phrases)
        return Grounded(text, tuple(_taken(instruction, words, named)), error.message)

    def ground_names(self, instruction: str, layout: Layout | None = None) -> Grounded:
        """An instruction of which nobody taught the words: its objects by their names, the rest as it stands.

        What stands where objects do must be one of the scene; of several objects one must be named, since rows follow
        them in the order of mention.

        Raises:
            UngroundedInstructionError: if not, or if it says what not to do.
        """
        words = self._lexicon.read(instruction)
        text, named = passed_on(self, instruction, words, NounPhrases(words, self._lexicon, layout))
        check_named(self, instruction, words, named)
        return Grounded(text, tuple(_taken(instruction, words, named)))

    @cached_property
    def choices(self) -> tuple[str, ...]:
        """What an instruction can stand for: the taught ones, and these about other objects."""
        found = dict.fromkeys(self.instructions)
        for text in islice(self._about_others(), MAX_CHOICES):
            if len(found) < MAX_CHOICES and self._literal(text) is not None:
                found.setdefault(text)
        return tuple(found)

    def _about_others(self) -> Iterator[str]:
        for frame in self.frames:
            mine = tuple(dict.fromkeys(mention.name for mention in frame.named))
            for others in permutations(self.names, len(mine)) if frame.may_stand_alone else ():
                if (text := frame.text_for(dict(zip(mine, others, strict=True)), self.names)) is not None:
                    yield text

    @property
    def names_objects(self) -> bool:
        """Whether some taught instruction names an object."""
        return any(mention_order(self.names, text) for text in self.instructions)

    @cached_property
    def _lexicon(self) -> Lexicon:
        return Lexicon(self.names, self.aliases, self.instructions, self._is_word)

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """The taught instructions, each clause a frame."""
        return tuple(frame for text in self.instructions for frame in frames_of(text, self._lexicon))

    @cached_property
    def _fixed(self) -> frozenset[str]:
        return frozenset(word for frame in self.frames for word in frame.clause.fixed)

    @cached_property
    def _verbs(self) -> frozenset[str]:
        own = {taught_verb(frame.text, self._lexicon) for frame in self.frames}
        return frozenset(own - self._lexicon.objects_of.keys())

    @cached_property
    def _templates(self) -> tuple[frozenset[str], frozenset[str]]:
        """Of whole taught instructions, and of clauses that need not stand beside others."""
        whole = frozenset(template(self.names, text) for text in self.instructions)
        parts = [{template(self.names, part) for part in clauses(text)} for text in self.instructions]
        return whole, frozenset(part for each in parts if len(each) == 1 for part in each)

    def _literal(self, instruction: str) -> Grounded | None:
        """The instruction itself, if it is a taught one or such a one about other objects."""
        whole, parts = self._templates
        known = template(self.names, instruction) in whole
        strung = clauses(instruction)
        named = [name for part in strung for name in mention_order(self.names, part)]
        apart = len(set(named)) == len(named)  # else what was taken elsewhere may be wanted again
        if not known and not (apart and all(template(self.names, part) in parts for part in strung)):
            return None
        if instruction not in self.instructions and self._says_where_only(instruction):
            return None  # "turn left" has the form of "turn left tap"
        return Grounded(instruction, tuple(self._mentioned(instruction)))

    def _says_where_only(self, instruction: str) -> bool:
        """Whether words of place stand for an object without its noun, where a direction can stand as well."""
        said = {word.text for word in self._lexicon.read(instruction)}
        return any(
            instruction[start:end].lower() in PLACE_ADJECTIVES and noun_of(phrase_of(name)) not in said
            for start, end, name in mentions(self.names, instruction)
        )

    def _mentioned(self, instruction: str) -> Iterator[Grounding]:
        found = mentions(self.names, instruction)
        for start, end, name in found:
            yield Grounding(instruction[start:end], name, "name")
        if not found and len(self.names) == 1:
            yield Grounding(instruction, self.names[0], "taught")

    def _understood(self, instruction: str, words: Sequence[Word], phrases: NounPhrases) -> list[Grounded]:
        """Every different thing that the instruction may ask for."""
        sentences = Sentences(words, phrases, self._fixed, self._verbs)
        found: dict[str, Grounded] = {}
        try:
            for forms in islice(sentences.readings(), MAX_READINGS):
                for plan in next(filter(None, (list(self._plans(form)) for form in forms)), []):
                    if (text := self._canonical(plan)) is not None:
                        named = {phrase for filled in plan for phrase in filled.clause.phrases}
                        taken = tuple(
                            _taken(instruction, words, sorted(named, key=lambda phrase: phrase.start))
                        ) or tuple(self._mentioned(instruction))
                        grounded = Grounded(text, taken)
                        found[text] = min(found.get(text, grounded), grounded, key=_uncertainty)
        except TooInvolvedError:
            return []
        return list(found.values())

    def _plans(self, reading: Sequence[Clause]) -> Iterator[tuple[_Filled, ...]]:
        """The reading in frames that were taught one after the other, or each on its own."""
        per_clause = [self._choices(clause) for clause in reading]
        for choice in islice(product(*per_clause), MAX_READINGS):
            plan = tuple(filled for part in choice for filled in part)
            signatures = tuple(filled.frame.signature for filled in plan)
            alone = all(filled.frame.may_stand_alone for filled in plan)
            if any(signatures == frame.plan for frame in self.frames) or (alone and not _wants_moved(plan)):
                yield plan

    def _choices(self, clause: Clause) -> list[tuple[_Filled, ...]]:
        """The frames of a clause, one for each thing that it may ask for; "red and blue" is asked one by one."""
        if whole := self._best(clause):
            return [(filled,) for filled in whole]
        objects = clause.objects_in(DIRECT)
        if len(objects) < 2 or len(clause.roles) > 1:
            return []
        parts = [self._best(replace(clause, roles=((DIRECT, (phrase,)),))) for phrase in objects]
        return list(product(*parts)) if all(parts) else []

    def _best(self, clause: Clause) -> list[_Filled]:
        """The clause as frames have it: with its own verb, if that was taught, and as many of its words as possible."""
        every = [
            _Filled(frame, objects, clause)
            for frame in self.frames
            if (objects := frame.filled(clause, self.names)) is not None
        ]
        for exact in (_has_instrument, _has_verb, _has_words):
            every = [filled for filled in every if exact(filled)] or every
        by_signature: dict[object, _Filled] = {}
        for filled in sorted(every, key=lambda filled: not filled.is_as_taught):
            by_signature.setdefault(filled.frame.signature, filled)
        return list(by_signature.values())

    def _canonical(self, plan: Sequence[_Filled]) -> str | None:
        texts = [filled.frame.text_for(filled.objects, self.names) for filled in plan]
        known = [text for text in texts if text is not None]
        if len(known) < len(texts):
            return None
        return _JOINT.join([*(text.rstrip(". ") for text in known[:-1]), known[-1]])


def _wants_moved(plan: Sequence[_Filled]) -> bool:
    """Whether an object is asked for again after it was taken elsewhere: only where it was seen is known.

    To pick it up twice is as it was said.
    """
    moved: set[str] = set()
    for k, filled in enumerate(plan):
        picks = filled.clause.verb in PICKING and len(filled.clause.roles) <= 1
        again = picks and k > 0 and filled.objects == plan[k - 1].objects and filled.frame is plan[k - 1].frame
        if not again and not moved.isdisjoint(phrase.name for phrase in filled.clause.phrases if phrase.name):
            return True
        if picks or any(role in DESTINATIONS or role == "off" for role, _ in filled.clause.roles):
            moved |= {phrase.name for phrase in filled.clause.objects_in(DIRECT) if phrase.name}
    return False


def _has_verb(filled: _Filled) -> bool:
    return filled.frame.clause.verb == filled.clause.verb


def _has_instrument(filled: _Filled) -> bool:
    return len(filled.frame.clause.objects_in(INSTRUMENT)) == len(filled.clause.objects_in(INSTRUMENT))


def _has_words(filled: _Filled) -> bool:
    return filled.frame.clause.fixed_phrases == filled.clause.fixed_phrases


def _uncertainty(grounded: Grounded) -> tuple[int, int]:
    """Less for readings that guess less."""
    return max((MEANS.index(each.by) for each in grounded.phrases), default=0), -len(grounded.phrases)


def _taken(instruction: str, words: Sequence[Word], phrases: Sequence[NounPhrase]) -> Iterator[Grounding]:
    """What each phrase was taken for."""
    for phrase in phrases:
        if phrase.name is not None:
            text = instruction[words[phrase.start].token.start : words[phrase.end - 1].token.end]
            yield Grounding(text, phrase.name, phrase.by)
