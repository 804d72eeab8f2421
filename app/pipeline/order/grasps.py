"""What an instruction asks the gripper to do: to take something, to move it to something else, or to put it down."""

import re

from app.pipeline.order.forms import BASE_VERBS
from app.pipeline.order.order import Order, verb_of
from app.pipeline.order.verbs import CARRYING, PUTTING, TAKING
from app.pipeline.order.vocabulary import DETERMINERS, SHORT_PREPOSITIONS

_DETERMINER = rf"(?:{'|'.join(DETERMINERS)}) "
_ADJECTIVE = rf"(?!(?:{'|'.join(SHORT_PREPOSITIONS)})\b)\w+ "
_OBJECT = rf"(?:{_DETERMINER}(?:{_ADJECTIVE}){{0,2}})?<(?P<place>\d+)>"  # "the small <0>", not "the lid of <0>"
_DIRECT_OBJECT = re.compile(rf"\b(?P<verb>\w+)(?: up| down| off| away)? (?:both )?{_OBJECT}")
_FURTHER_OBJECT = re.compile(rf"( \w+)?(,|,? and) {_OBJECT}")  # of a list
_NO_VERB = re.compile(rf"(?:{_DETERMINER})?<\d+>")  # "the cube into the box"
_INTO = re.compile(r"(?<!is )(?<!are )\b(?:in|into|inside|on|onto)(?: \w+)* <(?P<place>\d+)>")  # not "that is on <0>"
# "Take the cube to the plate", not "the cube next to the plate"
_SOMEWHERE = re.compile(
    r"(?<!next )(?<!close )(?<!closest )(?<!nearest )(?<!adjacent )\b(?:to|into|onto)(?: \w+)* <\d+>"
)


def taken(order: Order) -> tuple[str, ...]:
    """Return the objects that an instruction says to take, as far as they follow right upon a verb.

    Empty where the first verb says something else.
    """
    found: list[str] = []
    for clause in order.clauses:
        for match in _DIRECT_OBJECT.finditer(clause.form):
            if BASE_VERBS.get(match["verb"]) not in TAKING | PUTTING:
                continue
            places, end = [int(match["place"])], match.end()
            while further := _FURTHER_OBJECT.match(clause.form, end):
                places.append(int(further["place"]))
                end = further.end()
            found += [clause.objects[place] for place in places]
    return tuple(dict.fromkeys(found)) if order.clauses[0].verb in TAKING | PUTTING else ()


def puts_down(order: Order) -> bool:
    """Return whether an instruction says to let something go."""
    carried = [part for clause in order.clauses for part in clause.parts if verb_of(part) in CARRYING]
    if _NO_VERB.match(order.form):
        carried.append(order.form)
    return not PUTTING.isdisjoint(order.verbs) or any(_INTO.search(part) for part in carried)


def put_to(order: Order) -> tuple[str, ...]:
    """Return the objects that an instruction says to put something in or on."""
    found: list[str] = []
    puts = False
    for clause in order.clauses:
        for part in clause.parts:
            if (verb := verb_of(part)) in BASE_VERBS:  # not in "the <1> in the <2>", after "put the <0>"
                puts = verb in CARRYING | PUTTING
            found += [clause.objects[int(match["place"])] for match in _INTO.finditer(part) if puts]
    return tuple(dict.fromkeys(found))
