"""Regular forms of words: plurals of nouns; pushes, pushing and pushed of "push"."""

import re

from app.pipeline.order.verbs import FIRST_WORDS, HOLDING, IRREGULAR, REACHING


def plurals_of(singular: str) -> set[str]:
    """The regular plurals of a word."""
    plurals = {f"{singular}s", f"{singular}es"}
    for ending, plural in (("y", "ies"), ("f", "ves"), ("fe", "ves")):
        if singular.endswith(ending):
            plurals.add(singular.removesuffix(ending) + plural)
    return plurals


def singulars_of(plural: str) -> set[str]:
    """The words that may have it as a regular plural."""
    endings = (("s", ""), ("es", ""), ("ies", "y"), ("ves", "f"), ("ves", "fe"))
    return {plural.removesuffix(ending) + singular for ending, singular in endings if plural.endswith(ending)}


def verb_forms(verb: str) -> set[str]:
    """The regular forms of a verb's base form: pushes, pushing, pushed; placing, tapped, carries."""
    short = verb[:-1] if verb.endswith("e") else verb
    doubled = verb + verb[-1] if re.fullmatch(r".*[^aeiou][aeiou][bdgmnpt]", verb) else short
    past = f"{verb[:-1]}ied" if verb.endswith("y") else f"{doubled}ed"
    return plurals_of(verb) | {f"{short}ing", f"{doubled}ing", past, f"{short}ed"}


# The base form of each form of a verb
VERB_FORMS = {form: verb for verb in FIRST_WORDS for form in verb_forms(verb)}
VERB_FORMS |= IRREGULAR | {verb: verb for verb in FIRST_WORDS}
_REACHED = HOLDING | REACHING  # verbs that say when a motion is done, and are no part of the grammar
BASE_VERBS = {form: verb for verb in _REACHED for form in (verb, *verb_forms(verb))} | VERB_FORMS
