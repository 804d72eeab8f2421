"""What may be wrong with demonstrations, as transformations that undo it; the gain of evidence names the fault.

A new fault of a recorder is one entry of `hypotheses`. Each changes the arrays of all recordings at once (a change of
single demonstrations would be computed ten times) and is reported, not applied: what is harmless is in `alike`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, islice

import numpy as np

from app.pipeline.skill import turns
from app.pipeline.skill.choice import FLOOR_M, WIDTH_M, choose
from app.pipeline.skill.evidence import posterior
from app.pipeline.skill.recording import Rows
from app.pipeline.skill.ways import Which
from roboprompt_client.types.arrays import Array

PRIOR = -4.0  # log prior of each hypothesis
UPRIGHT, UPRIGHT_RAD = 0.95, np.radians(10)  # share of objects that stand upright, and what counts as such
DOWN, DOWNWARDS = 0.8, 0.7  # share of acting hands that point down, and the cosine that counts as such
ANYHOW = 0.15  # of hands that point anywhere, the share that points down by chance: (1 - DOWNWARDS) / 2
SCALES = (0.8, 0.9, 1.1, 1.25)  # of a hand's positions: cameras and kinematics that are off by a tenth or a fifth
CONVENTION = "another-convention"
MAX_EXCHANGED = 6  # pairs of objects that are tried
W_FIRST = [1, 2, 3, 0]
MIRROR, MIRROR_TURN = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0, 1.0])

Change = Callable[[Rows], Rows]


@dataclass(frozen=True)
class Hypothesis:
    """A fault, and what undoes it.

    Attributes:
        remedy: what to do about it.
        scale: by which it multiplies the hand's positions: a density of what is smaller is larger.
    """

    code: str
    says: str
    remedy: str
    change: Change
    scale: float = 1.0


def hypotheses(rows: Rows) -> Iterator[Hypothesis]:
    """Yield the faults that recordings may have."""
    order = "send quaternions as x y z w"
    base = "give positions and rotations of hand and objects in one world frame"
    yield Hypothesis(CONVENTION, "the hand's quaternions have w first", order, _of_hand(lambda q: q[..., W_FIRST]))
    yield Hypothesis(CONVENTION, "objects' quaternions have w first", order, _of_objects(lambda q: q[..., W_FIRST]))
    yield Hypothesis(CONVENTION, "the hand's rotations are inverse", base, _of_hand(turns.inverse))
    yield Hypothesis(CONVENTION, "objects' rotations are inverse", base, _of_objects(turns.inverse))
    yield Hypothesis(CONVENTION, "objects' yaws have the wrong sign", base, _of_objects(_yaw_negated))
    yield Hypothesis(CONVENTION, "the hand is mirrored", base, _moved(lambda p: p * MIRROR, lambda q: q * MIRROR_TURN))
    swapped = _moved(lambda p: p[..., [1, 0, 2]], lambda q: q)
    yield Hypothesis(CONVENTION, "the hand's x and y are exchanged", base, swapped)
    for degrees in (90, -90, 180):
        q = turns.about_z(np.radians(degrees))
        said = f"the hand's frame is turned by {degrees} degrees"
        yield Hypothesis(CONVENTION, said, base, _base_turned(q))
    for scale in SCALES:
        said = f"the hand's positions are {1 / scale:.2f} times as large as they are"
        yield Hypothesis(CONVENTION, said, "check the unit and the calibration", _scaled(scale), scale)
    for one, other in islice(combinations(range(len(rows.scenes.keys)), 2), MAX_EXCHANGED):
        said = f"{rows.scenes.keys[one]} and {rows.scenes.keys[other]} are exchanged"
        yield Hypothesis("names-exchanged", said, "check which object is which", _exchanged(one, other))


def explained(rows: Rows, which: Which | None = None) -> list[tuple[Hypothesis, float]]:
    """Return hypotheses under which recordings gain evidence, with the gain in nats, the best first.

    Args:
        rows: those in which the hand acts.
        which: (N,) the recordings that have the fault; None: all.
    """
    now = log_evidence(rows)
    changed = ((one, one.change(rows)) for one in hypotheses(rows))
    gains = [
        (one, _gain(one, other if which is None else _mixed(other, rows, which), rows, now)) for one, other in changed
    ]
    return sorted(((one, gain) for one, gain in gains if gain > 0), key=lambda pair: -pair[1])


def _gain(one: Hypothesis, changed: Rows, rows: Rows, now: float) -> float:
    """Return the gain of evidence; the Jacobian of what shrinks residuals counts, else that would always gain."""
    return log_evidence(changed) - now + PRIOR + float(rows.hand.size * np.log(min(one.scale, 1)))


def log_evidence(rows: Rows) -> float:
    """Return how probable rows are, with what one knows: objects stand upright, hands point down and start alike."""
    total = sum(row.log_evidence for row in choose(rows))
    up = np.median(turns.rotated(rows.scenes.turn, turns.UP)[..., 2], axis=0)
    upright = np.count_nonzero(np.arccos(np.clip(up, -1, 1)) < UPRIGHT_RAD)
    cap = 1 - np.cos(UPRIGHT_RAD)  # share of a sphere's half
    total += upright * np.log(UPRIGHT / cap) + (len(up) - upright) * np.log(1 - UPRIGHT)
    level = np.median(turns.rotated(rows.turn, turns.UP)[..., 2], axis=0)
    down = np.count_nonzero(level < -DOWNWARDS)
    total += down * np.log(DOWN / ANYHOW) + (len(level) - down) * np.log((1 - DOWN) / (1 - ANYHOW))
    return float(total + posterior(rows.scenes.start.T, FLOOR_M, WIDTH_M).log_evidence.sum())


Map = Callable[[Array], Array]


def _moved(places: Map, rotations: Map) -> Change:
    """Return the change of the hand's places and rotations."""

    def change(rows: Rows) -> Rows:
        scenes = rows.scenes
        start = replace(scenes, start=places(scenes.start), start_turn=rotations(scenes.start_turn))
        return replace(rows, hand=places(rows.hand), turn=rotations(rows.turn), scenes=start)

    return change


def _of_hand(rotations: Map) -> Change:
    return _moved(lambda place: place, rotations)


def _base_turned(q: Array) -> Change:
    return _moved(lambda p: turns.rotated(q, p), lambda turn: turns.product(q, turn))


def _scaled(scale: float) -> Change:
    return _moved(lambda p: p * scale, lambda q: q)


def _of_objects(rotations: Map) -> Change:
    def change(rows: Rows) -> Rows:
        return replace(rows, scenes=replace(rows.scenes, turn=rotations(rows.scenes.turn)))

    return change


def _yaw_negated(turn: Array) -> Array:
    return turns.product(turns.about_z(-2 * turns.yaw(turn)), turn)


def _exchanged(one: int, other: int) -> Change:
    def change(rows: Rows) -> Rows:
        order = list(range(len(rows.scenes.keys)))
        order[one], order[other] = other, one
        place, turn = rows.scenes.place[:, order], rows.scenes.turn[:, order]
        return replace(rows, scenes=replace(rows.scenes, place=place, turn=turn))

    return change


def _mixed(changed: Rows, plain: Rows, which: Which) -> Rows:
    """Return rows that are changed in some recordings."""

    def of(one: Array, other: Array) -> Array:
        return np.where(which.reshape(-1, *(1,) * (one.ndim - 1)), one, other)

    a, b = changed.scenes, plain.scenes
    start, start_turn = of(a.start, b.start), of(a.start_turn, b.start_turn)
    scenes = replace(b, place=of(a.place, b.place), turn=of(a.turn, b.turn), start=start, start_turn=start_turn)
    return replace(plain, scenes=scenes, hand=of(changed.hand, plain.hand), turn=of(changed.turn, plain.turn))
