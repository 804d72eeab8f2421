"""Other words for the instructions of a case: rules that read an instruction must not depend on how it is said."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from benchmarks.adversary.case import Case, Poses, Recording, mentioned

Wording = Callable[[str, tuple[str, ...]], str]
"""Makes other words of an instruction and the objects that it mentions."""

GERUNDS = {
    "push": "pushing", "stack": "stacking", "open": "opening", "destack": "destacking", "close": "closing",
    "screw": "screwing", "take": "taking", "put": "putting", "unplug": "unplugging", "slide": "sliding",
    "turn": "turning", "sweep": "sweeping", "place": "placing",
}  # fmt: skip
PUTS = ("put", "place", "stack")


def _first_word(instruction: str) -> tuple[str, str]:
    verb, _, rest = instruction.partition(" ")
    return verb.lower(), rest


def _gerund(instruction: str, _: tuple[str, ...]) -> str:
    verb, rest = _first_word(instruction)
    return f"{GERUNDS.get(verb, verb)} {rest}"


def _third_person(instruction: str, _: tuple[str, ...]) -> str:
    verb, rest = _first_word(instruction)
    return f"the robot {verb}{'es' if verb.endswith('sh') else 's'} {rest}"


def _fetching(instruction: str, names: tuple[str, ...]) -> str:
    verb, _ = _first_word(instruction)
    return f"pick up the {names[0]} and bring it to the {names[-1]}" if verb in PUTS and len(names) > 1 else instruction


def _moving(instruction: str, names: tuple[str, ...]) -> str:
    verb, rest = _first_word(instruction)
    return f"move {rest}" if verb in PUTS and len(names) > 1 else instruction


def _names_only(instruction: str, names: tuple[str, ...]) -> str:
    return " and ".join(names) or instruction


WORDINGS: Mapping[str, Wording] = {
    "polite": lambda instruction, _: f"please {instruction}",
    "infinitive": lambda instruction, _: f"to {instruction}",
    "numbered": lambda instruction, _: f"task 3: {instruction}",
    "capitals": lambda instruction, _: instruction.upper(),
    "without articles": lambda instruction, _: instruction.replace(" the ", " "),
    "gerund": _gerund,
    "third person": _third_person,
    "fetching": _fetching,
    "moving": _moving,
    "names only": _names_only,
}


def worded(case: Case, wording: Wording) -> Case:
    """Return the case in other words."""

    def said(instruction: str, objects: Poses) -> str:
        return wording(instruction.rstrip("."), mentioned(instruction, objects))

    def recorded(recordings: tuple[Recording, ...]) -> tuple[Recording, ...]:
        return tuple(replace(item, instruction=said(item.instruction, item.objects)) for item in recordings)

    return replace(
        case,
        recordings=recorded(case.recordings),
        instruction=said(case.instruction, case.objects),
        others=recorded(case.others),
    )
