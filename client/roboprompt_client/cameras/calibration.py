"""Calibrate cameras against the arm: one bundle adjustment of all cameras and the board, over several hand poses.

Either the cameras stand still and the hand holds the board, or the hand carries the cameras and the board lies still.
A closed-form solution is refined by minimizing the corners' reprojection errors over all poses at once.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import cv2
import numpy as np

from roboprompt_client.cameras.board import find_board, rms_length
from roboprompt_client.cameras.rig import Intrinsics
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import import_extra
from roboprompt_client.types.arrays import Array

MIN_POSES = 6  # of the hand at which a camera saw the board
MIN_TURN_DEG = 20.0  # between poses, about two axes; with less the camera's position is not determined
GOOD_PX, GOOD_M, GOOD_DEG = 0.5, 0.003, 0.3


@dataclass(frozen=True, eq=False)
class Sighting:
    """The board as one camera saw it at one pose of the hand.

    Attributes:
        camera: its name.
        hand_to_world: (4, 4).
        points_m: (N, 3) corners in the board's frame.
        corners_px: (N, 2) the same corners in the picture.
    """

    camera: str
    hand_to_world: Array
    points_m: Array
    corners_px: Array


@dataclass(frozen=True, eq=False)
class FittedCamera:
    """A camera's fitted pose, and the fit's residuals.

    Attributes:
        mount: (4, 4) `camera_to_world`, or `camera_to_hand` if the hand carries it.
        rms_px: reprojection error of the corners, root mean square.
        off_m, off_deg: distance of the fitted board from its pose in each single picture, median over the poses.
        num_poses: number of poses at which the camera saw the board.
    """

    mount: Array
    rms_px: float
    off_m: float
    off_deg: float
    num_poses: int

    @property
    def advice(self) -> str:
        """What to do about large residuals; empty if they are small."""
        if self.rms_px > GOOD_PX:
            return "corners do not fit: measure the board's squares, fasten the board, check the camera's intrinsics"
        if self.off_m > GOOD_M or self.off_deg > GOOD_DEG:
            return "poses do not fit: check the hand's frame and base_to_world, and let the arm rest before pictures"
        return ""


def fit_cameras(
    sightings: Sequence[Sighting], intrinsics: Mapping[str, Intrinsics], *, carried: bool
) -> dict[str, FittedCamera]:
    """Return the fitted pose of each camera by name.

    Args:
        intrinsics: by camera name.
        carried: True if the hand carries the cameras, False if it holds the board.

    Raises:
        InvalidInputError: if a camera saw the board at too few poses, or the hand rotated too little.
    """
    views = {name: list(_views(sightings, name, k, carried=carried)) for name, k in intrinsics.items()}
    for name, of_camera in views.items():
        _check_poses(name, of_camera)
    mounts = [_hand_eye(of_camera) for of_camera in views.values()]
    first = next(iter(views.values()))[0]
    start = np.concatenate([_vector(first.carrier @ mounts[0] @ first.board_to_camera), *map(_vector, mounts)])

    def residuals(values: Array) -> Array:
        board, *found = map(_transform, values.reshape(-1, 6))
        pairs = zip(views.values(), found, strict=True)
        return np.concatenate([view.errors_px(mount, board).ravel() for seen, mount in pairs for view in seen])

    optimize = import_extra("scipy.optimize", "scipy", "calibrate")
    fitted = optimize.least_squares(residuals, start, x_scale="jac", loss="soft_l1")
    board, *found = map(_transform, fitted.x.reshape(-1, 6))
    return {name: _judged(seen, mount, board) for (name, seen), mount in zip(views.items(), found, strict=True)}


@dataclass(frozen=True, eq=False)
class _View:
    """A sighting, with poses relative to the frame in which the board does not move (the world's or the hand's).

    `carrier` (4, 4) is hand to world, or world to hand: `carrier @ mount` is the camera's pose in that frame.
    `board_to_camera` (4, 4) is estimated from this picture alone.
    """

    carrier: Array
    sighting: Sighting
    matrix: Array
    board_to_camera: Array

    @classmethod
    def of(cls, sighting: Sighting, k: Intrinsics, *, carried: bool) -> "_View":
        hand = sighting.hand_to_world
        turn, shift = find_board(sighting.points_m, sighting.corners_px, k.matrix)
        alone = _transform(np.concatenate([turn.ravel(), shift.ravel()]))
        carrier = np.asarray(hand if carried else np.linalg.inv(hand), np.float64)
        return cls(carrier, sighting, k.matrix, alone)

    def errors_px(self, mount: Array, board: Array) -> Array:
        """Return the reprojection errors (N, 2) of the corners for a camera's mount and the board's pose (4, 4)."""
        board_to_camera = np.linalg.inv(self.carrier @ mount) @ board
        in_camera = self.sighting.points_m @ board_to_camera[:3, :3].T + board_to_camera[:3, 3]
        pixels = in_camera @ self.matrix.T
        errors: Array = pixels[:, :2] / pixels[:, 2:] - self.sighting.corners_px
        return errors


def _views(sightings: Sequence[Sighting], camera: str, k: Intrinsics, *, carried: bool) -> Iterator[_View]:
    """Yield the views of one camera; pictures that two poses of the board explain equally are left out."""
    for sighting in sightings:
        if sighting.camera == camera:
            with suppress(InvalidInputError):
                yield _View.of(sighting, k, carried=carried)


def _check_poses(name: str, views: Sequence[_View]) -> None:
    field = f"cameras[{name}]"
    if len(views) < MIN_POSES:
        message = f"saw the board clearly at {len(views)} poses of the hand"
        remedy = f"at least {MIN_POSES}: the whole board in view, well lit, near and seen from the side"
        raise InvalidInputError(field, message, remedy)
    turns = [cv2.Rodrigues(views[0].carrier[:3, :3].T @ view.carrier[:3, :3])[0].ravel() for view in views]
    spread_deg = np.degrees(np.linalg.svd(np.array(turns), compute_uv=False) / np.sqrt(len(views)))
    if spread_deg[1] < MIN_TURN_DEG / 2:
        turned = " and ".join(f"{2 * spread:.0f}" for spread in spread_deg[:2])
        message = f"the hand rotated by about {turned} degrees between the poses"
        raise InvalidInputError(field, message, f"at least {MIN_TURN_DEG:g} about two axes: tilt the hand both ways")


def _hand_eye(views: Sequence[_View]) -> Array:
    """Return X (4, 4), the camera's pose in the frame that carries it, from A X = X B for each pair of poses.

    Park and Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE Trans. Robotics 1994:
    X rotates the axes of B's rotations into those of A's; its translation then follows from a linear system.
    """
    pairs = [
        (np.linalg.inv(after.carrier) @ before.carrier, after.board_to_camera @ np.linalg.inv(before.board_to_camera))
        for k, after in enumerate(views)
        for before in views[:k]
    ]
    turns_a, turns_b = (np.array([cv2.Rodrigues(pair[k][:3, :3])[0].ravel() for pair in pairs]) for k in (0, 1))
    u, _, v = np.linalg.svd(turns_a.T @ turns_b)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    slopes = np.concatenate([a[:3, :3] - np.eye(3) for a, _ in pairs])
    shift = np.linalg.lstsq(slopes, np.concatenate([turn @ b[:3, 3] - a[:3, 3] for a, b in pairs]), rcond=None)[0]
    mount = np.eye(4)
    mount[:3, :3], mount[:3, 3] = turn, shift
    return mount


def _judged(views: Sequence[_View], mount: Array, board: Array) -> FittedCamera:
    errors_px = np.concatenate([view.errors_px(mount, board) for view in views])
    off = [np.linalg.inv(view.board_to_camera) @ np.linalg.inv(view.carrier @ mount) @ board for view in views]
    off_m = float(np.median([np.linalg.norm(item[:3, 3]) for item in off]))
    off_rad = float(np.median([np.linalg.norm(cv2.Rodrigues(item[:3, :3])[0]) for item in off]))
    return FittedCamera(mount, rms_length(errors_px), off_m, float(np.degrees(off_rad)), len(views))


def _vector(transform: Array) -> Array:
    return np.concatenate([cv2.Rodrigues(transform[:3, :3])[0].ravel(), transform[:3, 3]])


def _transform(vector: Array) -> Array:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = cv2.Rodrigues(np.ascontiguousarray(vector[:3]))[0], vector[3:]
    return transform
