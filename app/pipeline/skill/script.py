"""The script of events that words let one expect, held against recorded motion by edit distance, in nats.

"Put the cup on the plate" says: close at the cup, then open at the plate. A recording says where the gripper switched.
Edits of the one into the other (Levenshtein's) have the price of their improbability.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from app.pipeline.order.grasps import put_to, puts_down, taken
from app.pipeline.order.order import Order
from app.pipeline.order.verbs import FETCHING, GRIPPING
from app.pipeline.skill.recording import Recording
from roboprompt_client.types.arrays import Array

# Log probabilities, in nats
MISSING = -5.0  # an event that words ask for does not happen,
FETCHED = -2.0  # if the verb says that something comes, not how: "get the plate" may be done by pushing
STARTS_CLOSED = -3.0
MOVING_AT_END, MOVING_AT_START = -4.0, -2.0
NO_TURN = -5.0  # all rotations of the hand are exactly none
AT_M = 0.03  # scale of the distances at which hands grasp and release: Student t with two degrees of freedom
SLOWEST_M_S, FASTEST_M_S = 0.02, 3.0  # of a hand at its fastest: no arm on a table is faster
MOVING_M_S, LEAVING_M_S = 0.05, 0.12  # a hand that stands still at its end and its start is slower
SLOW, SLOW_M_S = 0.1, 0.02  # of hands whose fingers act: a share of their usual speed, at least so much
MOST_SLOW = 5.0  # nats that a fast hand costs at most
STILL_M = 0.02  # a hand that goes no farther has done nothing with what it holds


class Expected(NamedTuple):
    """A switch of the gripper that words ask for.

    Attributes:
        objects: where it may happen; empty: anywhere.
        log_missing: the log probability that it does not happen.
    """

    opens: bool
    objects: tuple[str, ...]
    log_missing: float = MISSING


class Event(NamedTuple):
    """A switch of the gripper in a recording.

    Attributes:
        away_m: (K,) from where the objects of the scene stood at first.
    """

    opens: bool
    frame: int
    away_m: Array


class Fault(NamedTuple):
    """What of a recording is improbable, with its log probability."""

    name: str
    nats: float


HOLDS, ENDS_MOVING, STARTS_MOVING = "never lets go", "ends in motion", "starts in motion"


def expected(order: Order) -> list[Expected]:
    """Return the switches that an instruction asks for, in order."""
    found: list[Expected] = []
    for clause in order.clauses:
        found += _of_clause(Order(clause.text, order.names))
    return found


def _of_clause(order: Order) -> Iterator[Expected]:
    puts, takes, goals = puts_down(order), taken(order), put_to(order)
    fetches = order.verbs[:1] and order.verbs[0] in FETCHING and not puts
    grips = bool(takes) or puts or not GRIPPING.isdisjoint(order.verbs)
    for name in takes or (("",) if grips else ()):
        yield Expected(False, (name,) if name else (), FETCHED if fetches else MISSING)
        if puts:
            yield Expected(True, tuple(goal for goal in goals if goal != name))


def events(recording: Recording) -> list[Event]:
    """Return the switches after the hand has left its first pose."""
    places, positions = recording.scene.place, recording.motion.trajectory.positions_m
    return [
        Event(switch.opens, switch.frame, np.linalg.norm(places - positions[switch.frame], axis=1))
        for switch in recording.motion.acting_switches
    ]


def matched(wanted: Sequence[Expected], found: Sequence[Event], names: Sequence[str]) -> tuple[float, list[int | None]]:
    """Return the log probability of recorded switches, and the event that each expected one is; None where missing.

    Events that words do not ask for cost nothing: fingers close to push, or a second time after a failed grasp.
    """
    prices = np.zeros((len(wanted) + 1, len(found) + 1))
    prices[1:, 0] = np.cumsum([one.log_missing for one in wanted])
    for i, one in enumerate(wanted, start=1):
        for j, event in enumerate(found, start=1):
            edits = [prices[i - 1, j] + one.log_missing, prices[i, j - 1]]
            if one.opens == event.opens:
                edits.append(prices[i - 1, j - 1] + _elsewhere(one, event, names))
            prices[i, j] = max(edits)
    i, j = len(wanted), len(found)
    of: list[int | None] = [None] * i
    while i and j:
        if prices[i, j] == prices[i, j - 1]:
            j -= 1
        elif prices[i, j] == prices[i - 1, j] + wanted[i - 1].log_missing:
            i -= 1
        else:
            i, j = i - 1, j - 1
            of[i] = j
    return float(prices[-1, -1]), of


def _elsewhere(one: Expected, event: Event, names: Sequence[str]) -> float:
    """Return the log probability of an event's place, as against the object that is nearest there."""
    away = {name: float(off) for name, off in zip(names, event.away_m, strict=True)}
    own = [away[name] for name in one.objects if name in away]
    if not own:
        return 0.0
    return max(log_t(min(own)) - log_t(min(away.values())), one.log_missing)


def log_t(away_m: float) -> float:
    """Return the log density of a distance, up to a constant: Student t, two degrees of freedom."""
    return -1.5 * float(np.log1p((away_m / AT_M) ** 2 / 2))


def faults(recording: Recording, *, inverted: bool = False) -> list[Fault]:
    """Return what of a recording the words, or what one knows of hands, do not let one expect.

    Args:
        inverted: as if the gripper had been open where it was closed.
    """
    found = [event._replace(opens=event.opens ^ inverted) for event in events(recording)]
    wanted = expected(recording.order)
    done = bool(wanted) and None not in matched(wanted, found, recording.scene.names)[1]
    of_gripper, of_motion = _of_gripper(recording, found, inverted), _of_motion(recording, done=done)
    return [fault for fault in (*of_gripper, *of_motion) if fault.nats < 0]


def _of_gripper(recording: Recording, found: Sequence[Event], inverted: bool) -> Iterator[Fault]:
    wanted = expected(recording.order)
    nats, pairs = matched(wanted, found, recording.scene.names)
    missing = [one for one, event in zip(wanted, pairs, strict=True) if event is None]
    if missing and any(one.opens for one in missing):
        yield Fault(HOLDS, sum(one.log_missing for one in missing if one.opens))
    if missing and any(not one.opens for one in missing):
        yield Fault("does not close", sum(one.log_missing for one in missing if not one.opens))
    yield Fault("acts at another object", nats - sum(one.log_missing for one in missing))
    if (wanted or found) and bool(recording.motion.trajectory.gripper_open[0]) == inverted:
        yield Fault("starts closed", STARTS_CLOSED)
    if found and found[0].opens:
        yield Fault("opens before it closes", STARTS_CLOSED)
    if found and not found[-1].opens and _stays(recording, found[-1].frame):
        yield Fault("closes, and ends there", MISSING)


def _of_motion(recording: Recording, *, done: bool) -> Iterator[Fault]:
    given, speeds = recording.motion.trajectory, recording.motion.hand_speeds_m_s
    steps_m = np.linalg.norm(np.diff(given.positions_m, axis=0), axis=1)
    fastest = float((steps_m / np.maximum(np.diff(recording.motion.times_s), 1e-9)).max(initial=0.0))
    if not SLOWEST_M_S < fastest < FASTEST_M_S:
        yield Fault(f"moves at {fastest:.3g} m/s at most", MISSING)
    if speeds[-1] > MOVING_M_S and not done:  # what comes after all that words ask for may be cut off
        yield Fault(ENDS_MOVING, MOVING_AT_END)
    if speeds[0] > LEAVING_M_S:
        yield Fault(STARTS_MOVING, MOVING_AT_START)
    if np.abs(given.quaternions_xyzw[:, :3]).max() < 1e-6:
        yield Fault("the hand's rotation is exactly none", NO_TURN)


def _stays(recording: Recording, frame: int) -> bool:
    """Return whether the hand, which came from elsewhere, stays to the end where it is in a frame."""
    positions = recording.motion.trajectory.positions_m
    way_m = np.linalg.norm(positions - positions[frame], axis=1)
    return bool(way_m[frame:].max() < STILL_M < way_m[:frame].max(initial=0.0))


def fits(recording: Recording, shift_s: float) -> float:
    """Return how well switches fit to hands that rest and to objects that stand there, in nats.

    Args:
        shift_s: of the gripper's clock.
    """
    times_s, speeds = recording.motion.times_s, recording.motion.hand_speeds_m_s
    moving = speeds[speeds > SLOW_M_S]
    slow = max(SLOW_M_S, SLOW * float(np.median(moving))) if len(moving) else SLOW_M_S
    total = 0.0
    for event in events(recording):
        frame = int(np.clip(np.searchsorted(times_s, times_s[event.frame] + shift_s), 0, len(times_s) - 1))
        away = np.linalg.norm(recording.scene.place - recording.motion.trajectory.positions_m[frame], axis=1)
        total += log_t(float(away.min(initial=np.inf))) - min(float(speeds[frame]) / slow, MOST_SLOW)
    return total
