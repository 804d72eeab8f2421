"""The frame of each row: the candidate with the most evidence, for all rows of a plan together.

Each row of N recordings is seen from every candidate; the evidence of the six residuals says how well the candidate
explains it (`evidence`). A switching cost ties rows of one approach: the best sequence of frames is Viterbi's.
"""

import numpy as np
import numpy.typing as npt

from app.pipeline.skill import turns
from app.pipeline.skill.evidence import Posterior, posterior
from app.pipeline.skill.frames import ONE_AXIS, Candidates, Frame, is_named
from app.pipeline.skill.recording import Rows
from app.pipeline.skill.rows import AXES, Row
from roboprompt_client.types.arrays import Array

FLOOR_M, FLOOR_RAD = 0.003, np.radians(2.0)  # noise that is expected of a hand at an object: of scripted recordings
WIDTH_M, WIDTH_RAD = 1.0, np.pi  # a hand's reach, and all rotations about an axis
SWITCHING = -2.0  # log prior of a row with another origin, other axes, another hand than before, or all of them
VERTICAL = 2

State = tuple[int, int, int]  # of axes, origin and hand among the candidates


def choose(rows: Rows) -> tuple[Row, ...]:
    """Return each row in the frame that explains the recordings best."""
    return _Seen(rows).choose()


class _Seen:
    """R rows of N recordings as they are seen from every candidate: P axes and O origins of places, A of rotations."""

    def __init__(self, rows: Rows) -> None:
        self.rows, scenes = rows, rows.scenes
        self.candidates = found = Candidates.of(scenes)
        self.back = turns.inverse(np.array([scenes.axes(axes) for axes in found.axes]))  # (A, N, 4)
        origins = np.array([scenes.origin(origin) for origin in found.origins])  # (O, N, 3)
        off = rows.hand[None] - origins[:, :, None]  # (O, N, R, 3)
        seen = turns.rotated(self.back[: len(found.of_place), None, :, None], off[None])  # (P, O, N, R, 3)
        self.places = seen.transpose(3, 0, 1, 4, 2)  # (R, P, O, 3, N)
        self.place = posterior(self.places, FLOOR_M, WIDTH_M)
        hands = turns.product(self.back[:, None], np.moveaxis(rows.turn, 1, 0)[None])  # (A, R, N, 4)
        self.medoid = turns.medoid(hands)
        off_rad = turns.log(turns.product(turns.inverse(self.medoid)[..., None, :], hands))
        self.rotations = np.moveaxis(off_rad, -1, 2)  # (A, R, 3, N)
        self.turn = posterior(self.rotations, FLOOR_RAD, WIDTH_RAD)

    def choose(self) -> tuple[Row, ...]:
        """Return the rows, each in its frame."""
        of_turn = self.turn.log_evidence.sum(-1).T  # (R, A)
        of_place, origins = self._along_axes()  # (R, P, O), (R, P, O, 3)
        priors = self.candidates.place_prior(self.rows.scenes, self.rows.hand), self.candidates.hand_prior()
        total = (of_place + priors[0])[..., None] + of_turn[:, None, None] + priors[1][None, :, None]
        path = _viterbi(total)
        return tuple(self._row(k, state, origins[k], total[k]) for k, state in enumerate(path))

    def _row(self, k: int, state: State, origins: npt.NDArray[np.int_], total: Array) -> Row:
        axes, origin, hand = state
        along, found = origins[axes, origin], self.candidates
        one, two, three = (found.origins[o] for o in along)
        frame = Frame((one, two, three), found.axes[axes], found.axes[hand])
        place, turn = self.place.at((k, axes, along, AXES)), self.turn.at((hand, k))
        whole = Posterior(*(np.concatenate([getattr(place, n), getattr(turn, n)]) for n in NAMES))
        residuals = np.concatenate([self.places[k, axes][along, AXES], self.rotations[hand, k]])
        residuals = residuals - whole.mean[:, None]
        is_open = bool(self.rows.gripper_open[k])
        of_origin = total.max(axis=(0, 2)).tolist()
        rivals = {of.one: best for of, best in zip(found.origins, of_origin, strict=True) if of.kind == "object"}
        mean, evidence = self._mean(hand, k), float(total[state])
        return Row(frame, place.mean, mean, whole, residuals, is_open, evidence, rivals)

    def _mean(self, hand: int, k: int) -> Array:
        return turns.product(self.medoid[hand, k], turns.exp(self.turn.mean[hand, k]))

    def _along_axes(self) -> tuple[Array, npt.NDArray[np.int_]]:
        """Let single coordinates follow other things: x, y and z along the world's axes, z along all level ones."""
        origins, evidence = self.candidates.origins, self.place.log_evidence
        usable = [o for o, of in enumerate(origins) if of.kind == "world" or (of.kind == "object" and is_named(of.one))]
        other = evidence[:, :1, usable]  # (R, 1, O', 3)
        best, which = other.max(axis=2)[:, :, None], np.array(usable)[other.argmax(axis=2)][:, :, None]
        gain = best - evidence + ONE_AXIS  # (R, P, O, 3)
        level = np.array([axes.kind != "leaning" for axes in self.candidates.of_place])
        may = np.zeros((1, len(level), 1, 3), dtype=bool)
        may[:, 0], may[:, level, :, VERTICAL] = True, True
        takes = (gain > 0) & may
        own = np.broadcast_to(np.arange(len(origins))[:, None], evidence.shape)
        return evidence.sum(-1) + np.where(takes, gain, 0).sum(-1), np.where(takes, which, own)


NAMES = ("log_evidence", "mean", "shape", "rate", "number", "kept")


def _viterbi(total: Array) -> list[State]:
    """Return the best states of rows with log probabilities (R, P, O, A); changes of a part, or of all, have a cost.

    Parts change one after the other, so that a change of each is a maximum along one axis.
    """
    steps, score = [], total[0]
    for k in range(1, len(total)):
        index = np.arange(score.size).reshape(score.shape)
        for axis in range(3):
            at = np.expand_dims(score.argmax(axis=axis), axis)
            best = np.take_along_axis(score, at, axis) + SWITCHING
            index = np.where(best > score, np.take_along_axis(index, at, axis), index)
            score = np.maximum(score, best)
        best, at_best = score.max() + SWITCHING, score.argmax()
        index = np.where(best > score, index.ravel()[at_best], index)
        score = np.maximum(score, best)
        steps.append(index)
        score = score + total[k]
    flat = [int(score.argmax())]
    for index in reversed(steps):
        flat.append(int(index.ravel()[flat[-1]]))
    return [tuple(map(int, np.unravel_index(at, score.shape))) for at in flat[::-1]]  # type: ignore[misc]
