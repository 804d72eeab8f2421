"""Regular forms of English words: plurals of nouns; pushes, pushing and pushed of "push"."""

import re

from app.pipeline.order.verbs import FIRST_WORDS, HOLDING, IRREGULAR, REACHING


def plurals_of(singular: str) -> set[str]:
    """The regular plurals of a word."""
    if singular.endswith(("s", "x", "z", "ch", "sh")):
        return {f"{singular}es"}
    if re.search("[^aeiou]y$", singular):
        return {f"{singular[:-1]}ies"}
    plurals = {f"{singular}s"}
    for ending, plural in (("o", "oes"), ("f", "ves"), ("fe", "ves")):
        if singular.endswith(ending):
            plurals.add(singular.removesuffix(ending) + plural)
    return plurals


def singulars_of(plural: str) -> set[str]:
    """The words that may have it as a regular plural."""
    endings = (("s", ""), ("es", ""), ("ies", "y"), ("ves", "f"), ("ves", "fe"))
    found = {plural.removesuffix(ending) + singular for ending, singular in endings if plural.endswith(ending)}
    return {singular for singular in found if plural in plurals_of(singular)}


def verb_forms(verb: str) -> set[str]:
    """The regular forms of a verb's base form: pushes, pushing, pushed; placing, tapped, carries."""
    short = verb[:-1] if verb.endswith("e") else verb
    past = f"{verb[:-1]}ied" if re.search("[^aeiou]y$", verb) else f"{short}ed"
    forms = plurals_of(verb) | {f"{short}ing", past}
    if re.fullmatch(r".*[^aeiou][aeiou][bdgmnprt]", verb):
        one_syllable = re.fullmatch(r"(?:un)?[^aeiou]*[aeiou].", verb)  # "taping" is no form of "tap"
        forms = {f"{verb}s", *(set() if one_syllable else forms), f"{verb}{verb[-1]}ing", f"{verb}{verb[-1]}ed"}
    return forms


# The base form of each form of a verb
VERB_FORMS = {form: verb for verb in FIRST_WORDS for form in verb_forms(verb)}
VERB_FORMS |= IRREGULAR | {verb: verb for verb in FIRST_WORDS}
_REACHED = HOLDING | REACHING  # verbs that say when a motion is done, and are no part of the grammar
BASE_VERBS = {form: verb for verb in _REACHED for form in (verb, *verb_forms(verb))} | VERB_FORMS
