"""The closed classes of English that instructions are made of: function words, polite phrases, places, and colors."""

from collections.abc import Sequence

from app.pipeline.order.space import Pick, extreme, in_the_middle, on_side
from app.pipeline.order.words import NUMBERS, Phrase, PhraseTable, Word
from app.pipeline.order.words import phrases as _phrases

DETERMINERS = frozenset(["the", "a", "an", "that", "this", "your"])
SOME = DETERMINERS | {"some"}  # before a noun that names no object: "pour some water"
RETURNING = frozenset({"away", "back"})  # with a destination they say nothing more: "put it back on the shelf"
GENERIC_NOUNS = frozenset(["one", "thing", "object", "item"])
# Nouns that may stand for each other where something else tells the objects apart.
NOUN_KINDS = (frozenset({"cube", "block", "brick"}), frozenset({"cup", "mug"}), frozenset({"tap", "faucet"}))
COLORED = frozenset(["coloured", "colored", "colour", "color"])

# Politeness, wherever a clause has a place for it; addresses and lead-ins, where a clause begins.
_POLITE = "please,kindly,thanks,thank you,thank you very much,many thanks,for me,if you please,if possible,if you can"
FILLERS = _phrases(f"{_POLITE},now,right now,just")
FILLERS_OF_FORBIDDEN = _phrases(_POLITE)  # "not just the red one" wants it, too
LEADS = _phrases(
    "robot,hey,hello,hi,dear,ok,okay,so,well,could you,can you,would you,will you,i want you to,i would like you to,"
    "i need you to,i ask you to,you should,you must,you have to,you need to,you can,you may,you will,let us,"
    "go ahead and,go and,try to,be so kind as to,make sure to,make sure you,make sure that you,would you mind,"
    "do me a favor and,do me a favour and,your task is to,the task is to,your job is to,i am asking you to"
)
INSTEAD = _phrases("instead")
FIRST = _phrases("first,firstly,first of all,to begin with,start by,begin by,start with")
THEN = _phrases("then,after that,afterwards,afterward,next,finally,lastly,at last,after this,thereafter,subsequently")
NOT = _phrases("do not,never,not,you must not,you should not,please do not")
PASSIVE = _phrases("should be,must be,has to be,have to be,needs to be,need to be,is to be,are to be,shall be")
ORDERING = frozenset({"before", "after"})
YOU = _phrases("you")
EXCEPT = _phrases("except,except for")
BEFORE_GERUND = ORDERING | {"mind", "by", "with", "of", "than", "to"}  # "would you mind pushing", "instead of pushing"
SKIP = _phrases("ignore,forget,forget about,skip,leave out")
RATHER = _phrases("instead of,rather than,in place of,as opposed to")

# A role is named after the plainest of the prepositions that mean the same for a robot.
ROLES: dict[Phrase, str] = {
    phrase: role
    for role, text in {
        "on": "on,onto,on to,upon,on top of,atop,onto the top of,to the top of",
        "in": "in,into,in to,inside,inside of,within",
        "to": "to,towards,toward,over to,up to",
        "off": "off,off of,from,out of,away from,from off",
        "under": "under,underneath,below,beneath",
        "next to": "next to,beside,near,close to,alongside,adjacent to",
        "of": "of", "with": "with,using", "behind": "behind", "in front of": "in front of", "above": "above,over",
        "left of": "left of,to the left of,on the left of,to the left side of,on the left side of",
        "right of": "right of,to the right of,on the right of,to the right side of,on the right side of",
        "at": "at", "by": "by", "against": "against", "around": "around", "through": "through", "across": "across",
        "between": "between",
    }.items()
    for phrase in _phrases(text)
}  # fmt: skip
PREPOSITIONS = PhraseTable(ROLES)

ORDINALS = {
    word: place
    for place, words in enumerate(("first 1st", "second 2nd", "third 3rd", "fourth 4th", "fifth 5th", "sixth 6th"), 1)
    for word in words.split()
}
# Words that say which one rather than what: no noun, wherever a name has them.
PLACE_ADJECTIVES = frozenset(
    {"left", "right", "top", "bottom", "middle", "center", "centre", "upper", "lower", "front", "back", "rear"}
)
# Words before the noun by which a place picks an object.
PICKS: dict[Phrase, Pick] = {
    **{
        phrase: extreme(side)
        for side in ("left", "right")
        for phrase in _phrases(
            f"{side}most,{side} most,most {side},farthest {side},furthest {side},far {side},extreme {side},"
            f"outermost {side},very {side}"
        )
    },
    **dict.fromkeys(_phrases("topmost,top most,uppermost,highest"), extreme("top")),
    **dict.fromkeys(_phrases("bottommost,bottom most,lowest,lowermost"), extreme("bottom")),
    **{(side,): on_side(side) for side in ("left", "right", "top", "bottom")},
    **{(side, "hand"): on_side(side) for side in ("left", "right")},
    ("upper",): on_side("top"),
    ("lower",): on_side("bottom"),
    **dict.fromkeys(_phrases("middle,center,centre,central"), in_the_middle),
}
PLACES = PhraseTable(PICKS)
# Adjectives of place and size that stand for another one in names: the upper drawer is `drawer_top`.
IN_NAMES = {
    "upper": "top", "topmost": "top", "uppermost": "top", "highest": "top", "lower": "bottom", "bottommost": "bottom",
    "lowest": "bottom", "lowermost": "bottom", "leftmost": "left", "rightmost": "right", "center": "middle",
    "centre": "middle", "central": "middle", "big": "large", "large": "big", "little": "small", "small": "little",
}  # fmt: skip
EDGES = frozenset({"left", "right", "top", "bottom"})
COUNTED_FROM = {
    "leftmost": "left", "rightmost": "right", "left": "left", "right": "right", "top": "top", "bottom": "bottom",
    "above": "top", "below": "bottom", "highest": "top", "lowest": "bottom",
}  # fmt: skip
REACHES = {"closest": "near", "nearest": "near", "farthest": "far", "furthest": "far"}
ROBOT = _phrases("robot,robot arm,arm,robot base,base,you,yourself,your base,robot 's base")
_PLACED = ["located", "placed", "standing", "lying", "sitting", "positioned", "situated"]
BEING = PhraseTable(
    [(word,) for word in _PLACED]
    + [(pronoun, *said) for pronoun in ("that", "which") for said in (
        ("is",), ("stands",), ("lies",), ("sits",), *(("is", word) for word in _PLACED)
    )]
)  # fmt: skip
EXACTLY = _phrases("directly,immediately,just,right")
QUANTIFIERS = frozenset({"all", "both", "each", "every"})
BESIDE = _phrases("next to,beside,near,close to,adjacent to,alongside")
SIDES = _phrases("side,end,edge,hand side,hand edge")
SIDES_OF: dict[Phrase, str] = {
    ("behind",): "far",
    ("in", "front", "of"): "near",
    **dict.fromkeys(_phrases("above,over"), "top"),
    **dict.fromkeys(_phrases("below,under,underneath,beneath"), "bottom"),
    **{
        phrase: side
        for side in ("left", "right")
        for phrase in _phrases(
            f"{side} of,to the {side} of,on the {side} of,to the {side} side of,on the {side} side of,"
            f"at the {side} of,to your {side} of,on the {side} hand side of"
        )
    },
}
RELATIONS = PhraseTable((*SIDES_OF, *BESIDE))

# Color words by what the color looks like. The basic colors are those of Berlin and Kay ("Basic Color Terms", 1969):
# none of them stands for another, so that nothing among red, yellow and blue is purple. Every other word is listed with
# the basic colors that its shade may be called, by its median color in the xkcd color survey (2010, 222,500 people);
# libraries go by CSS, where azure is nearly white.
BASIC = frozenset(["black", "white", "red", "green", "yellow", "blue", "brown", "purple", "pink", "orange", "grey"])
_SHADES = {
    "red": "crimson scarlet ruby cherry vermilion vermillion carmine maroon burgundy claret tomato rouge reddish",
    "yellow": "lemon canary mustard gold golden dandelion sunflower yellowish",
    "green": "lime emerald jade olive grass moss mint forest avocado pistachio greenish",
    "blue": "azure navy cobalt sapphire ultramarine cerulean azul bluish blueish",
    "purple": "violet lavender lilac plum aubergine eggplant amethyst purplish",
    "pink": "rose bubblegum pinkish",
    "orange": "tangerine pumpkin apricot orangish",
    "brown": "chocolate chestnut sepia brownish",
    "grey": "gray slate greyish grayish",
    "white": "ivory whitish",
    "black": "ebony jet blackish",
}
_BETWEEN = {
    "teal": "green blue", "turquoise": "green blue", "cyan": "green blue", "aqua": "green blue",
    "aquamarine": "green blue", "chartreuse": "green yellow", "amber": "orange yellow", "saffron": "orange yellow",
    "magenta": "pink purple", "fuchsia": "pink purple", "orchid": "pink purple", "indigo": "blue purple",
    "periwinkle": "blue purple", "coral": "orange pink red", "salmon": "orange pink red", "peach": "orange pink",
    "rust": "orange brown", "copper": "orange brown", "bronze": "orange brown", "tan": "brown yellow",
    "beige": "white brown", "khaki": "green brown", "cream": "white yellow", "silver": "grey white",
    "charcoal": "grey black", "wine": "red purple", "mauve": "pink purple",
}  # fmt: skip
# What may stand before a color word without naming another basic color: "sky blue", "dark red".
SHADES_OF = frozenset({
    "light", "dark", "bright", "pale", "deep", "vivid", "intense", "sky", "royal", "baby", "blood", "racing", "bottle",
    "pastel", "neon",
})  # fmt: skip

COLORS: dict[str, frozenset[str]] = {
    **{name: frozenset({name}) for name in BASIC},
    **{word: frozenset({name}) for name, words in _SHADES.items() for word in words.split()},
    **{word: frozenset(names.split()) for word, names in _BETWEEN.items()},
}

ADJECTIVES = PLACE_ADJECTIVES | BASIC | ORDINALS.keys() | set(NUMBERS) | set(NUMBERS.values()) | {"1"}

MARKS = frozenset({",", ".", ";", "?"})
_TABLES = (
    *(FILLERS, LEADS, INSTEAD, FIRST, THEN, NOT, PASSIVE, SKIP, RATHER, PREPOSITIONS, PLACES, ROBOT, BEING, EXACTLY),
    *(SIDES, RELATIONS),
)
_ALONE = frozenset(
    {"and", "but", "or", "nor", "it", "between", "middle", "center", "centre", "extreme", "very", "to", "of", "away"}
    | {"all", "them", "both", "use", "some", "again", "away", "back", "'s"}
)
# Words that never tell an object apart by themselves, even where a name has them: "a block" is not `block a`.
NEVER_LOOSE = DETERMINERS | GENERIC_NOUNS | {word for phrase in PREPOSITIONS for word in phrase} - {
    "left", "right", "top", "front"
} | {"and", "or", "not", "it", "is"}  # fmt: skip
NAMELESS = NEVER_LOOSE | REACHES.keys() | QUANTIFIERS | {"other", "another"}  # no alias consists of these alone
FUNCTION_WORDS = (
    frozenset(word for table in _TABLES for phrase in table for word in phrase)
    | {*DETERMINERS, *COLORED, *ORDINALS, *REACHES, *MARKS, *_ALONE}
)  # fmt: skip


def forbids(words: Sequence[Word]) -> bool:
    """Return whether some words forbid an action ("not", "skip", "instead of")."""
    texts = [word.text for word in words]
    tables = (NOT, SKIP, RATHER)
    return any(table.end_at(texts, k) is not None for table in tables for k in range(len(texts)))


def look_alike(one: str, other: str) -> bool:
    """Whether two color words may be said of one thing."""
    return not COLORS[one].isdisjoint(COLORS[other])


PLACE_WORDS = frozenset({*COUNTED_FROM, *REACHES, *PLACE_ADJECTIVES})  # that say which of several objects
