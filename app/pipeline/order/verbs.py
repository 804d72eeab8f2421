"""Verbs of manipulation that ask for the same motion, by family.

Two verbs are alike if some family has both and the family's condition holds for what the instruction names: "push the
block to the wall" is a kind of sliding, "push the button" a kind of pressing. What stands in no family is like itself
only. The families keep apart what differs for a robot: pulling is not opening, wiping is not sweeping.
"""

from collections.abc import Callable, Collection
from typing import NamedTuple

from app.pipeline.order.words import PhraseTable, verb_forms

DESTINATIONS = frozenset({
    "to", "on", "in", "against", "next to", "left of", "right of", "behind", "in front of", "under", "above", "between",
})  # fmt: skip


def _nowhere(roles: Collection[str]) -> bool:
    return not roles


def _somewhere(roles: Collection[str]) -> bool:
    return not DESTINATIONS.isdisjoint(roles)


class Family(NamedTuple):
    """Verbs that are alike where `holds` is true of the roles that a clause fills besides the direct object.

    Attributes:
        one_destination: whether "to", "into" and "onto" say the same with these verbs.
    """

    verbs: frozenset[str]
    holds: Callable[[Collection[str]], bool] = lambda _roles: True
    one_destination: bool = False


def _verbs(text: str) -> frozenset[str]:
    return frozenset(part.strip() for part in text.split(","))


PICKING = _verbs("pick, pick up, grasp, grab, grip, take, lift, lift up, get, take hold of, grab hold of")
FAMILIES: tuple[Family, ...] = (
    Family(
        _verbs(
            "push, press, tap, hit, poke, click, depress, push down, press down, push in, press in, push on, press on,"
            "tap on, click on, push down on, press down on"
        ),
        _nowhere,
    ),
    Family(PICKING, _nowhere),
    Family(
        _verbs("take, remove, lift, lift up, pick, pick up, get, grab, destack, unstack, de stack, un stack"),
        lambda roles: "off" in roles,
    ),
    Family(_verbs("put, put down, place, set, set down, lay, lay down, position")),
    Family(
        _verbs("stack, stack up, pile, put, put down, place, set, set down, lay, lay down, move"),
        lambda roles: not {"on", "in"}.isdisjoint(roles),
    ),
    Family(
        _verbs("insert, put, place, move, drop, deposit, stow, store, load, transfer, bring, fit"),
        lambda roles: "in" in roles,
    ),
    Family(_verbs("put, place, set, lay, move, shift, bring, transfer, carry"), _somewhere),
    Family(_verbs("give, hand, pass, hand over, pass over")),
    Family(_verbs("turn on, switch on")),
    Family(_verbs("turn off, switch off")),
    Family(_verbs("open, open up, pull open, slide open"), _nowhere),
    Family(_verbs("close, shut, push shut, push closed, slide shut, slide closed"), _nowhere),
    Family(_verbs("turn, rotate, twist, turn around, rotate around")),
    Family(_verbs("slide, push, shove, move"), _somewhere, one_destination=True),
    Family(_verbs("sweep, brush"), one_destination=True),
    Family(_verbs("wipe, wipe down")),
    Family(_verbs("pull, tug, yank")),
    Family(_verbs("pour, pour out")),
    Family(_verbs("screw, screw in")),
    Family(_verbs("unscrew, screw out")),
    Family(_verbs("unplug, disconnect")),
    Family(_verbs("plug, plug in, connect")),
    Family(_verbs("destack, unstack, de stack, un stack")),
    Family(_verbs("flip, toggle")),
    Family(_verbs("hang, hang up")),
)
PHRASES = frozenset(phrase for family in FAMILIES for phrase in family.verbs)
FIRST_WORDS = frozenset(phrase.split()[0] for phrase in PHRASES) | {
    "shake", "fold", "throw", "drop", "drag", "squeeze", "stir", "touch", "release", "cut", "spin", "roll", "shove",
}  # fmt: skip
TABLE = PhraseTable(tuple(phrase.split()) for phrase in PHRASES)
PARTICLES = frozenset(word for phrase in PHRASES for word in phrase.split()[1:])
_IRREGULAR = {"took": "take", "taken": "take", "gotten": "get", "laid": "lay", "hung": "hang", "swept": "sweep"}


# From every form of the verbs to their base form
FORMS = {form: verb for verb in FIRST_WORDS for form in verb_forms(verb)}
FORMS |= _IRREGULAR | {verb: verb for verb in FIRST_WORDS}
