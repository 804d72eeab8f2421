"""The words that all tasks share, as tables: function words, prepositions, places, colors and verbs.

A table is a text of phrases between commas, or rows of ``heading: phrases`` where the heading is what the phrases mean.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Generic, TypeVar

from app.pipeline.order.space import Pick, extreme, in_the_middle, on_side

Phrase = tuple[str, ...]
Meaning = TypeVar("Meaning")


class PhraseTable(dict[Phrase, Meaning], Generic[Meaning]):
    """What phrases mean, to be looked up at a word of a text."""

    def __init__(self, meanings: Mapping[Phrase, Meaning]) -> None:
        super().__init__(meanings)
        self._by_first: dict[str, list[Phrase]] = {}
        for phrase in sorted(meanings, key=len, reverse=True):
            self._by_first.setdefault(phrase[0], []).append(phrase)

    def all_at(self, texts: Sequence[str], at: int) -> Iterator[Phrase]:
        """Yield the phrases of the table that begin at word `at`, the longest first."""
        for phrase in self._by_first.get(texts[at], ()) if at < len(texts) else ():
            if len(phrase) == 1 or tuple(texts[at : at + len(phrase)]) == phrase:
                yield phrase

    def end_at(self, texts: Sequence[str], at: int) -> int | None:
        """Return the end of the longest phrase that begins at word `at`; None without one."""
        phrase = next(self.all_at(texts, at), None)
        return None if phrase is None else at + len(phrase)


def _listed(text: str) -> list[Phrase]:
    return [tuple(phrase.split()) for phrase in text.split(",")]


def _rows(text: str) -> Iterator[tuple[str, list[Phrase]]]:
    for row in text.strip().splitlines():
        heading, _, listed = row.partition(":")
        yield heading, _listed(listed)


def _phrases(text: str) -> PhraseTable[None]:
    return PhraseTable(dict.fromkeys(_listed(text)))


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Spellings: what a token is written out as
WRITTEN_OUT = {
    "don't": "do not", "dont": "do not", "doesn't": "does not", "mustn't": "must not", "shouldn't": "should not",
    "can't": "can not", "cannot": "can not", "won't": "will not", "isn't": "is not", "i'd": "i would",
    "i'll": "i will", "let's": "let us", "that's": "that is", "it's": "it is", "you'd": "you would",
    "you'll": "you will", "there's": "there is", "which's": "which is",
    "anticlockwise": "counterclockwise", "leftward": "left", "leftwards": "left", "rightward": "right",
    "rightwards": "right", "forwards": "forward", "backwards": "backward", "upward": "up", "upwards": "up",
    "downward": "down", "downwards": "down",
    "(": ",", ":": ",", "\u2013": ",", "\u2014": ",", "!": ".", "\u2026": ".",
}  # fmt: skip
DROPPED = frozenset("\"'`\u2018\u2019\u201c\u201d\u00ab\u00bb-\u2010\u2011)")  # "left-hand" reads as "left hand"

# Numbers and nouns. "One" is no number here: it stands for a thing, as in "the blue one".
NUMBERS = {word: str(number) for number, word in enumerate(
    ["two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"], start=2
)}  # fmt: skip
ORDINALS = {word: place for place, words in enumerate(
    ("first 1st", "second 2nd", "third 3rd", "fourth 4th", "fifth 5th", "sixth 6th"), start=1
) for word in words.split()}  # fmt: skip
DETERMINERS = _words("the a an that this your")
SOME = DETERMINERS | {"some"}  # before a noun that names no object: "pour some water"
QUANTIFIERS = _words("all both each every")
GENERIC_NOUNS = _words("one thing object item")
NOUN_KINDS = (_words("cube block brick"), _words("cup mug"), _words("tap faucet"))  # may stand for each other if clear
TIMES: dict[Phrase, int] = {
    ("twice",): 2, ("thrice",): 3, **{(number, "times"): int(number) for number in NUMBERS.values()}
}  # fmt: skip

# What surrounds and joins clauses
_POLITE = "please, kindly, thanks, thank you, thank you very much, many thanks, for me, if you please, if possible, " \
    "if you can"  # fmt: skip
FILLERS = _phrases(f"{_POLITE}, now, right now, just")
FILLERS_OF_FORBIDDEN = _phrases(_POLITE)  # "not just the red one" wants it, too
LEADS = _phrases(
    "robot, hey, hello, hi, dear, ok, okay, so, well, could you, can you, would you, will you, i want you to, "
    "i would like you to, i need you to, i ask you to, you should, you must, you have to, you need to, you can, "
    "you may, you will, let us, go ahead and, go and, try to, be so kind as to, make sure to, make sure you, "
    "make sure that you, would you mind, do me a favor and, do me a favour and, your task is to, the task is to, "
    "your job is to, i am asking you to"
)
INSTEAD = _phrases("instead")
FIRST = _phrases("first, firstly, first of all, to begin with, start by, begin by, start with")
THEN = _phrases(
    "then, after that, afterwards, afterward, next, finally, lastly, at last, after this, thereafter, subsequently"
)
NOT = _phrases("do not, never, not, you must not, you should not, please do not")
SKIP = _phrases("ignore, forget, forget about, skip, leave out")
RATHER = _phrases("instead of, rather than, in place of, as opposed to")
EXCEPT = _phrases("except, except for")
PASSIVE = _phrases("should be, must be, has to be, have to be, needs to be, need to be, is to be, are to be, shall be")
YOU = _phrases("you")
ORDERING = _words("before after")
BEFORE_GERUND = ORDERING | _words("mind by with of than to")  # "would you mind pushing", "instead of pushing"
RETURNING = _words("away back")  # with a destination they say nothing more: "put it back on the shelf"
MARKS = frozenset(",.;")

# Each role of an object is named after the plainest of the prepositions that mean the same for a robot.
PREPOSITIONS = PhraseTable({phrase: role for role, listed in _rows("""
on: on, onto, on to, upon, on top of, atop, onto the top of, to the top of
in: in, into, in to, inside, inside of, within
to: to, towards, toward, over to, up to
off: off, off of, from, out of, away from, from off
under: under, underneath, below, beneath
next to: next to, beside, near, close to, alongside, adjacent to
left of: left of, to the left of, on the left of, to the left side of, on the left side of
right of: right of, to the right of, on the right of, to the right side of, on the right side of
above: above, over
with: with, using
of: of
behind: behind
in front of: in front of
at: at
by: by
against: against
around: around
through: through
across: across
between: between
""") for phrase in listed})  # fmt: skip
SHORT_PREPOSITIONS = frozenset(words[0] for words in PREPOSITIONS if len(words) == 1)
DESTINATIONS = frozenset({
    "to", "on", "in", "against", "next to", "left of", "right of", "behind", "in front of", "under", "above", "between",
})  # fmt: skip

# Places. Adjectives of place say which one rather than what: they are no nouns, wherever a name has them.
PLACE_ADJECTIVES = _words("left right top bottom middle center centre upper lower front back rear")
EDGES = _words("left right top bottom")
PLACES: PhraseTable[Pick] = PhraseTable({
    **{phrase: extreme(side) for side, listed in _rows("""
left: leftmost, left most, most left, farthest left, furthest left, far left, extreme left, outermost left, very left
right: rightmost, right most, most right, farthest right, furthest right, far right, extreme right, outermost right
right: very right
top: topmost, top most, uppermost, highest
bottom: bottommost, bottom most, lowest, lowermost
""") for phrase in listed},
    **{phrase: on_side(side) for side, listed in _rows("""
left: left, left hand
right: right, right hand
top: top, upper
bottom: bottom, lower
""") for phrase in listed},
    **dict.fromkeys(_listed("middle, center, centre, central"), in_the_middle),
})  # fmt: skip
# Adjectives of place and size that stand for another one in names: the upper drawer is `drawer_top`.
IN_NAMES = {
    "upper": "top", "topmost": "top", "uppermost": "top", "highest": "top", "lower": "bottom", "bottommost": "bottom",
    "lowest": "bottom", "lowermost": "bottom", "leftmost": "left", "rightmost": "right", "center": "middle",
    "centre": "middle", "central": "middle", "big": "large", "large": "big", "little": "small", "small": "little",
}  # fmt: skip
COUNTED_FROM = {
    "leftmost": "left", "rightmost": "right", "left": "left", "right": "right", "top": "top", "bottom": "bottom",
    "above": "top", "below": "bottom", "highest": "top", "lowest": "bottom",
}  # fmt: skip
REACHES = {"closest": "near", "nearest": "near", "farthest": "far", "furthest": "far"}
ROBOT = _phrases("robot, robot arm, arm, robot base, base, you, yourself, your base, robot 's base")
_PLACED = "located, placed, standing, lying, sitting, positioned, situated"
BEING = _phrases(", ".join((
    _PLACED, "that is, that stands, that lies, that sits, which is, which stands, which lies, which sits",
    *(f"{pronoun} is {word}" for pronoun in ("that", "which") for word in _PLACED.split(", ")),
)))  # fmt: skip
EXACTLY = _phrases("directly, immediately, just, right")
SIDES = _phrases("side, end, edge, hand side, hand edge")
RELATIONS = PhraseTable({phrase: side for side, listed in _rows("""
on: on, on top of
next to: next to, beside, near, close to, adjacent to, alongside
far: behind
near: in front of
top: above, over
bottom: below, under, underneath, beneath
left: left of, to the left of, on the left of, to the left side of, on the left side of, at the left of
left: to your left of, on the left hand side of
right: right of, to the right of, on the right of, to the right side of, on the right side of, at the right of
right: to your right of, on the right hand side of
""") for phrase in listed})  # fmt: skip

# Colors: what the color of a word may be called. The basic colors are those of Berlin and Kay ("Basic Color Terms",
# 1969): none stands for another, so that nothing among red, yellow and blue is purple. Other words are listed with the
# basic colors that their shade may be called, by the median color in the xkcd color survey (2010, 222,500 people);
# libraries go by CSS, where azure is nearly white.
BASIC = _words("black white red green yellow blue brown purple pink orange grey")
_SHADES = """
red: crimson, scarlet, ruby, cherry, vermilion, vermillion, carmine, maroon, burgundy, claret, tomato, rouge, reddish
yellow: lemon, canary, mustard, gold, golden, dandelion, sunflower, yellowish
green: lime, emerald, jade, olive, grass, moss, mint, forest, avocado, pistachio, greenish
blue: azure, navy, cobalt, sapphire, ultramarine, cerulean, azul, bluish, blueish
purple: violet, lavender, lilac, plum, aubergine, eggplant, amethyst, purplish
pink: rose, bubblegum, pinkish
orange: tangerine, pumpkin, apricot, orangish
brown: chocolate, chestnut, sepia, brownish
grey: gray, slate, greyish, grayish
white: ivory, whitish
black: ebony, jet, blackish
green blue: teal, turquoise, cyan, aqua, aquamarine
green yellow: chartreuse
orange yellow: amber, saffron
pink purple: magenta, fuchsia, orchid, mauve
blue purple: indigo, periwinkle
orange pink red: coral, salmon
orange pink: peach
orange brown: rust, copper, bronze
brown yellow: tan
white brown: beige
green brown: khaki
white yellow: cream
grey white: silver
grey black: charcoal
red purple: wine
"""
COLORS: dict[str, frozenset[str]] = {name: frozenset({name}) for name in BASIC} | {
    word: _words(basic) for basic, listed in _rows(_SHADES) for (word,) in listed
}
COLORED = _words("coloured colored colour color")
# What may stand before a color word without naming another basic color: "sky blue", "dark red".
SHADES_OF = _words("light dark bright pale deep vivid intense sky royal baby blood racing bottle pastel neon")


def look_alike(one: str, other: str) -> bool:
    """Whether two color words may be said of one thing."""
    return not COLORS[one].isdisjoint(COLORS[other])


# Sets of words that other modules ask for

ADJECTIVES = PLACE_ADJECTIVES | BASIC | ORDINALS.keys() | NUMBERS.keys() | set(NUMBERS.values()) | {"1"}
# Words that change what a clause asks for, as numbers do: "in the reverse order"
ALTERING = _words(
    "reverse reversed backward inverse inverted opposite contrary alternate alternating ascending descending first "
    "last half halfway partly partially almost nearly slightly only except without once twice thrice never"
)
DIRECTIONS = _words(
    "left right up down forward backward clockwise counterclockwise sideways upside inside outside north south east "
    "west open closed shut on off in out"
)
DECIDING = ALTERING | DIRECTIONS | ADJECTIVES  # without them a clause means something else
# Roles that say where something is, rather than in which direction it goes
LOCATIONS = frozenset({"on", "in", "at", "of", "under", "above", "next to", "behind", "in front of", "by", "against"})
# They never stand for themselves: "press no button" is not "press the button no longer"
NEVER_FIXED = _words("and but or nor not never no none neither nothing without unless until then it again use")
_TABLES: tuple[Iterable[Phrase], ...] = (
    *(FILLERS, LEADS, INSTEAD, FIRST, THEN, NOT, PASSIVE, SKIP, RATHER, PREPOSITIONS, PLACES, ROBOT, BEING, EXACTLY),
    *(SIDES, RELATIONS),
)
FUNCTION_WORDS = (
    frozenset(word for table in _TABLES for phrase in table for word in phrase)
    | {*DETERMINERS, *COLORED, *ORDINALS, *REACHES, *MARKS, "'s"}
    | _words("and but or nor it between middle center centre extreme very to of away all them both use some again back")
)
# Words that never tell an object apart by themselves, even where a name has them: "a block" is not `block a`.
NEVER_LOOSE = DETERMINERS | GENERIC_NOUNS | _words("and or not it is") | (
    {word for phrase in PREPOSITIONS for word in phrase} - {"left", "right", "top", "front"}
)  # fmt: skip
NAMELESS = NEVER_LOOSE | REACHES.keys() | QUANTIFIERS | {"other", "another"}  # no alias consists of these alone
