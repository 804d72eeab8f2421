"""Verbs of manipulation that ask for the same motion, by family.

Two verbs are alike if some family has both and the clause fills its roles: "push the block to the wall" is a kind of
sliding, "push the button" a kind of pressing. What stands in no family is like itself only. The families keep apart
what differs for a robot: pulling is not opening, wiping is not sweeping.
"""

from collections.abc import Collection
from typing import NamedTuple

from app.pipeline.order.vocabulary import DESTINATIONS, PhraseTable


class Family(NamedTuple):
    """Verbs that are alike if a clause has certain roles besides the direct object.

    Attributes:
        roles: of which the clause must fill one; if there is none here, it must fill none; None: any clause.
        one_destination: whether "to", "into" and "onto" say the same with these verbs.
    """

    verbs: frozenset[str]
    roles: frozenset[str] | None
    one_destination: bool

    def holds(self, roles: Collection[str]) -> bool:
        """Return whether the verbs are alike in a clause that fills these roles besides the direct object."""
        if self.roles is None:
            return True
        return not self.roles.isdisjoint(roles) if self.roles else not roles


def _family(verbs: str, roles: Collection[str] | None = None, *, one_destination: bool = False) -> Family:
    return Family(frozenset(verbs.split(", ")), None if roles is None else frozenset(roles), one_destination)


_NO_ROLE: tuple[str, ...] = ()
_PRESSES = (
    "push, press, tap, hit, poke, click, depress, push down, press down, push in, press in, push on, press on, tap on, "
    "click on, push down on, press down on"
)
_PICKS = "pick, pick up, grasp, grab, grip, take, lift, lift up, get, take hold of, grab hold of"
FAMILIES = (
    _family(_PRESSES, _NO_ROLE),
    _family(_PICKS, _NO_ROLE),
    _family("take, remove, lift, lift up, pick, pick up, get, grab, destack, unstack, de stack, un stack", ["off"]),
    _family("put, put down, place, set, set down, lay, lay down, position"),
    _family("stack, stack up, pile, put, put down, place, set, set down, lay, lay down, move", ["on", "in"]),
    _family("insert, put, place, move, drop, deposit, stow, store, load, transfer, bring, fit", ["in"]),
    _family("put, place, set, lay, move, shift, bring, transfer, carry", DESTINATIONS),
    _family("give, hand, pass, hand over, pass over"),
    _family("turn on, switch on"),
    _family("turn off, switch off"),
    _family("open, open up, pull open, slide open", _NO_ROLE),
    _family("close, shut, push shut, push closed, slide shut, slide closed", _NO_ROLE),
    _family("turn, rotate, twist, turn around, rotate around"),
    _family("slide, push, shove, move", DESTINATIONS, one_destination=True),
    _family("sweep, brush", one_destination=True),
    _family("wipe, wipe down"),
    _family("pull, tug, yank"),
    _family("pour, pour out"),
    _family("screw, screw in"),
    _family("unscrew, screw out"),
    _family("unplug, disconnect"),
    _family("plug, plug in, connect"),
    _family("destack, unstack, de stack, un stack"),
    _family("flip, toggle"),
    _family("hang, hang up"),
)
PICKING = frozenset(_PICKS.split(", "))
PHRASES = frozenset(phrase for family in FAMILIES for phrase in family.verbs)
TABLE = PhraseTable({tuple(phrase.split()): None for phrase in PHRASES})
PARTICLES = frozenset(word for phrase in PHRASES for word in phrase.split()[1:])
FIRST_WORDS = frozenset(phrase.split()[0] for phrase in PHRASES) | {
    "shake", "fold", "throw", "drop", "drag", "squeeze", "stir", "touch", "release", "cut", "spin", "roll", "shove",
}  # fmt: skip
IRREGULAR = {
    "took": "take", "taken": "take", "gotten": "get", "laid": "lay", "hung": "hang", "swept": "sweep",
    "brought": "bring", "gave": "give", "given": "give", "slid": "slide", "threw": "throw", "thrown": "throw",
}  # fmt: skip
CONTAINING = frozenset({"open", "open up", "close", "shut"})  # "put the mug in the drawer and close it": the drawer
TOGETHER = frozenset({"stack", "stack up", "pile"})  # "stack A and B on C" does not say that B stands on C
# First words of verbs, by what recorded hands do
TAKING = frozenset({"pick", "grasp", "grab", "grip", "take", "lift", "get", "remove", "destack", "unstack"})
FETCHING = frozenset({"get", "take", "remove"})  # of `TAKING`, what does not say that the hand lifts
HOLDING = frozenset({"grasp", "grab", "grip", "hold", "squeeze", "pinch"})  # done once fingers are closed
PUTTING = frozenset({
    "put", "place", "position", "set", "lay", "stack", "pile", "insert", "hang", "drop", "deposit", "store", "stow",
})  # fmt: skip
SHIFTING = frozenset({"move", "shift"})  # one object to another: the hand carries it or slides it
CARRYING = SHIFTING | {"bring", "carry", "transfer"}  # into or onto something: it is put down there
# What cannot be done without a grasp, though the verb does not say so
GRIPPING = frozenset(
    {"screw", "unscrew", "plug", "unplug", "pour", "carry", "bring", "transfer", "give", "hand", "pass"}
)
REACHING = frozenset({"reach", "approach"})  # done once the hand is near
