"""Colour words by what the colour looks like: which of the basic colours people would call it.

The basic colours are those of Berlin and Kay ("Basic Color Terms", 1969): none of them stands for another, so that
nothing among red, yellow and blue is purple. Every other word is listed with the basic colours that its shade may be
called, by its median colour in the xkcd colour survey (2010, 222,500 people); libraries go by CSS, where azure is
nearly white. A test holds the list against the survey's hues.
"""

BASIC = frozenset(["black", "white", "red", "green", "yellow", "blue", "brown", "purple", "pink", "orange", "grey"])
_SHADES = {
    "red": "crimson scarlet ruby cherry vermilion vermillion carmine maroon burgundy claret tomato rouge",
    "yellow": "lemon canary mustard gold golden dandelion sunflower",
    "green": "lime emerald jade olive grass moss mint forest avocado pistachio",
    "blue": "azure navy cobalt sapphire ultramarine cerulean azul",
    "purple": "violet lavender lilac plum aubergine eggplant amethyst",
    "pink": "rose bubblegum",
    "orange": "tangerine pumpkin apricot",
    "brown": "chocolate chestnut sepia",
    "grey": "slate",
    "white": "ivory",
    "black": "ebony jet",
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
_SAME = {
    "gray": "grey", "reddish": "red", "greenish": "green", "yellowish": "yellow", "bluish": "blue", "blueish": "blue",
    "purplish": "purple", "pinkish": "pink", "orangish": "orange", "brownish": "brown", "greyish": "grey",
    "grayish": "grey", "blackish": "black", "whitish": "white",
}  # fmt: skip
# What may stand before a colour word without naming another basic colour: "sky blue", "dark red".
SHADES_OF = frozenset(
    {"light", "dark", "bright", "pale", "deep", "vivid", "intense", "sky", "royal", "baby", "blood", "racing", "bottle"}
    | {"pastel", "neon"}
)

COLOURS: dict[str, frozenset[str]] = {
    **{name: frozenset({name}) for name in BASIC},
    **{word: frozenset({name}) for name, words in _SHADES.items() for word in words.split()},
    **{word: frozenset(names.split()) for word, names in _BETWEEN.items()},
    **{word: frozenset({name}) for word, name in _SAME.items()},
}


def look_alike(one: str, other: str) -> bool:
    """Whether two colour words may be said of one thing."""
    return not COLOURS[one].isdisjoint(COLOURS[other])
