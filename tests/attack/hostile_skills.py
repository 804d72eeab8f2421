"""Sequences with other skills than picking and placing, by recordings of hands that never rest, without joints.

What a hand does with a tool, how often and in which sense, and demonstrations that contradict each other there.
"""

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from roboprompt_client.types.trajectory import Trajectory
from tests.attack.hostile_sequences import NEAR_M, Attack, sequence

RATE_HZ, SPEED_M_S, SPEED_RAD_S = 20, 0.25, 1.2
DOWN, FORWARD = Rotation.from_quat([1.0, 0.0, 0.0, 0.0]), Rotation.from_euler("y", 90, degrees=True)
UP = np.array([0.0, 0.0, 1.0])
POURED_DEG = 100.0
TURNS_DEG = {"a_whole_turn": 360, "one_and_a_half_turns": 540}


def flowing(stops):
    """Through (place, rotation, gripper open), as fast as hands move, slowest at each."""
    positions, hands, is_open = [np.array([0.1, 0.0, 1.2])], [stops[0][1]], [stops[0][2]]
    for place, hand, opens in stops:
        way, turn = np.asarray(place) - positions[-1], (hands[-1].inv() * hand).as_rotvec()
        seconds = max(np.linalg.norm(way) / SPEED_M_S, np.linalg.norm(turn) / SPEED_RAD_S, 0.15)
        start_m, start = positions[-1], hands[-1]
        for share in np.linspace(0, 1, max(2, round(RATE_HZ * seconds)))[1:]:
            eased = share**3 * (10 - 15 * share + 6 * share**2)
            positions.append(start_m + eased * way)
            hands.append(start * Rotation.from_rotvec(eased * turn))
            is_open.append(is_open[-1])
        if opens != is_open[-1]:  # the fingers take a moment
            positions += [positions[-1]] * 8
            hands += [hands[-1]] * 8
            is_open += [is_open[-1]] * 4 + [opens] * 4
    quaternions = Rotation.concatenate(hands).as_quat()
    return Trajectory(np.zeros((len(positions), 0)), np.array(positions), quaternions, np.array(is_open))


def taken(place, hand=DOWN):
    """Approached against the hand's own axis, closed on, and lifted."""
    away = hand.apply([0.0, 0.0, -0.1])
    return [(place + away, hand, 1), (place, hand, 0), (place + 0.2 * UP, hand, 0)]


def _taught(name, what, words, names, stops, right, *, number=6, **options):
    """Demonstrations of `stops(k, places)`; the answer must be `right(actions, places)`."""

    def tried(a: Attack):
        for k in range(number):
            places = {name: np.array(place) for name, place in a.places(*names).items()}
            a.teach(words, places, flowing(stops(k, places)))
        places = {name: np.array(place) for name, place in a.places(*names).items()}
        return a.ask(words, places, **options), lambda actions: right(actions, places)

    return sequence(tried, name, what)


def visits(actions, place):
    """How often the hand comes to a place."""
    near = [np.linalg.norm(np.subtract(action["position"], place)) < NEAR_M for action in actions]
    return sum(now and not before for before, now in pairwise([False, *near]))


# Again and again


def _presses(times, height_m):
    def stops(_, places):
        low = places["bell"] + 0.02 * UP
        return [(low + 0.1 * UP, DOWN, 0), *[(low, DOWN, 0), (low + height_m * UP, DOWN, 0)] * times]

    return stops


for _times, _words in ((2, "press the bell twice"), (3, "ring the bell three times")):
    for _height_m in (0.08, 0.1):
        _taught(
            f"pressed_{_times}_times_{100 * _height_m:.0f}_cm_high",
            "To and fro on one line: is it one way?",
            _words,
            ("bell", "lamp"),
            _presses(_times, _height_m),
            lambda actions, places, times=_times: visits(actions, places["bell"] + 0.02 * UP) == times,
        )


def _strokes(tool, goal, offset, number=3, off_m=(0.0, 0.0, 0.0), every=1):
    """With a tool to the goal and aside, again and again; every so-manieth recording does it elsewhere."""

    def stops(k, places):
        at = places[goal] + 0.03 * UP + (off_m if k % every == 0 else 0.0)
        return [*taken(places[tool]), (at + 0.15 * UP, DOWN, 0), *[(at, DOWN, 0), (at + offset, DOWN, 0)] * number]

    return stops


def _struck(goal, times):
    return lambda actions, places: visits(actions, places[goal] + 0.03 * UP) == times


WIPE, HAMMER = "wipe the stain with the sponge", "strike the nail with the hammer"
_wiped = (WIPE, ("stain", "sponge"), _strokes("sponge", "stain", np.array([0.0, 0.16, 0.0])), _struck("stain", 3))
_hammered = (HAMMER, ("nail", "hammer"), _strokes("hammer", "nail", 0.1 * UP), _struck("nail", 3))
_taught("wiped_to_and_fro", "Three strokes on one line.", *_wiped)
_taught("hammered_three_times", "Three strokes of one height.", *_hammered)


# Turns


def _turned(turn_deg):
    def stops(_, places):
        hands = [Rotation.from_euler("z", deg, degrees=True) * DOWN for deg in np.linspace(0, turn_deg, 7)]
        end = (places["knob"] + 0.1 * UP, hands[-1], 1)
        at = [(places["knob"], hand, 0) for hand in hands[1:]]
        return [*taken(places["knob"])[:2], *at, (places["knob"], hands[-1], 1), end]

    return stops


def _turns_by(turn_deg):
    """Whether the hand turns by as much while it is closed, from each action to the next by the shorter way."""

    def right(actions, _):
        closed = [k for k, action in enumerate(actions) if not action["gripper_open"]]
        hands = Rotation.from_quat([action["quaternion_xyzw"] for action in actions[closed[0] : closed[-1] + 2]])
        return abs(float((hands[1:] * hands[:-1].inv()).as_rotvec(degrees=True)[:, 2].sum()) - turn_deg) < 15

    return right


for _name, _turn_deg in TURNS_DEG.items():
    _taught(
        _name, "An arm turns by the shorter way.", "turn the knob", ("knob",), _turned(_turn_deg), _turns_by(_turn_deg)
    )


# With something in the hand


def _pours(off_m=(0.0, 0.0, 0.0), every=1, turned=True):
    """From a cup, which is put back; every so-manieth recording beside the bowl, or without turning the cup."""
    tilted = Rotation.from_euler("x", -POURED_DEG, degrees=True) * FORWARD

    def stops(k, places):
        odd, cup = k % every == 0, places["cup"]
        at = places["bowl"] + [0.0, -0.06, 0.16] + (np.array(off_m) if odd else 0.0)
        poured = [(at, FORWARD, 0), (at, tilted if turned or not odd else FORWARD, 0), (at, FORWARD, 0)]
        lifted, lowered = (cup + 0.2 * UP, FORWARD, 0), [(cup, FORWARD, 1), (cup - [0.1, 0.0, 0.0], FORWARD, 1)]
        return [*taken(cup, FORWARD), *poured, lifted, *lowered]

    return stops


def _is_poured(actions, places):
    """Whether the cup is turned over the bowl, and nowhere else."""
    tilted = [
        action["position"]
        for action in actions
        if (FORWARD.inv() * Rotation.from_quat(action["quaternion_xyzw"])).magnitude() > np.radians(60)
    ]
    goal = places["bowl"] + [0.0, -0.06, 0.16]
    return bool(tilted) and all(np.linalg.norm(np.subtract(place, goal)) < 2 * NEAR_M for place in tilted)


POUR = ("pour the cup into the bowl", ("cup", "bowl"))
_beside = {"off_m": (0.0, 0.18, 0.0)}


@sequence
def poured_by_one_recording(a):
    """The bowl is named, and is no bystander; asked is where it alone stands elsewhere."""
    places = {name: np.array(place) for name, place in a.places(*POUR[1]).items()}
    a.teach(POUR[0], places, flowing(_pours()(0, places)))
    moved = {**places, "bowl": places["bowl"] + np.array([0.05, -0.08, 0.0])}
    return a.ask(POUR[0], moved), lambda actions: _is_poured(actions, moved)


for _every in (2, 4):
    _what = f"One recording of {_every} does it, ten in all."
    _taught(
        f"poured_18_cm_beside_in_one_of_{_every}", _what, *POUR, _pours(**_beside, every=_every), _is_poured, number=10
    )
    _taught(f"not_poured_in_one_of_{_every}", _what, *POUR, _pours(turned=False, every=_every), _is_poured, number=10)
_taught(
    "poured_beside_in_the_only_one_shown",
    "Of ten recordings five pour 18 cm beside the bowl, and a prompt shows the first.",
    *(*POUR, _pours(**_beside, every=2), _is_poured),
    number=10,
    num_demonstrations=1,
)
for _name, (_words, _names, _, _right) in {"wiped": _wiped, "hammered": _hammered}.items():
    _goal, _tool = _names
    _aside = 0.1 * UP if _name == "hammered" else np.array([0.0, 0.16, 0.0])
    _stops = _strokes(_tool, _goal, _aside, off_m=(0.0, 0.3, 0.0), every=2)
    _taught(f"{_name}_30_cm_beside_in_half", "Nothing is let go of.", _words, _names, _stops, _right, number=10)
