"""Where a camera stands, from pictures of a ChArUco board of known pose."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.charuco import CharucoBoard
from app.perception.rigid import inverse
from app.pipeline.arrays import Array
from app.pipeline.camera import Camera
from app.pipeline.errors import InvalidInputError

MIN_CORNERS = 8
MAX_RMS_PX = 0.5  # sharp pictures have 0.1; a focal length that is 20 % off costs no more than 0.6 on a small board
MAX_MOTION_PX = 2.0  # of a corner between pictures; noise moves it by a tenth of that
RIVAL_RAD = np.radians(3.0)  # two poses that differ by less are one
RIVAL_ERROR = 1.5  # a rival whose error is larger by this factor is out of the question


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera whose pose is known.

    Attributes:
        camera: with `camera_to_world`, and the image size that the pictures had.
        rms_px: how far the board's corners lie from where this pose puts them, root mean square.
        max_px: the farthest of them.
        corners: how many were seen, over all pictures.
        position_sigma_m: standard deviation of where the board lies before the camera, as the corners' errors suggest.
        rotation_sigma_rad: the same of the camera's rotation.
    """

    camera: Camera
    rms_px: float
    max_px: float
    corners: int
    position_sigma_m: float
    rotation_sigma_rad: float


def calibrate(
    camera: Camera,
    pictures: Sequence[npt.NDArray[np.uint8]],
    board: CharucoBoard,
    board_to_world: Array,
    *,
    max_rms_px: float = MAX_RMS_PX,
) -> Calibration:
    """The camera's pose from one or more (H, W, 3) pictures, between which neither camera nor board moved.

    Args:
        camera: with the right intrinsics; its `camera_to_world` is replaced. Pictures are free of lens distortion.
        board_to_world: (4, 4); see `CharucoBoard` for the board's axes.

    Raises:
        InvalidInputError: if the board is not seen, or moved, or its corners do not fit any or just one pose.
    """
    size_px = _one_size(pictures)
    points_m, corners_px = _seen(pictures, board)
    matrix = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
    turn, shift = _board_to_camera(points_m, corners_px, matrix)
    errors_px, slopes = _errors(points_m, corners_px, matrix, turn, shift)
    rms_px = _rms(errors_px)
    if rms_px > max_rms_px:
        remedy = "right intrinsics and board measures, and pictures whose lens distortion was removed"
        raise InvalidInputError("pictures", f"corners lie {rms_px:.2f} px off any pose (rms)", remedy)
    board_to_camera = np.eye(4)
    board_to_camera[:3, :3], board_to_camera[:3, 3] = cv2.Rodrigues(turn)[0], shift.ravel()
    spread = np.linalg.inv(slopes.T @ slopes) * rms_px**2 / 2
    return Calibration(
        replace(camera, camera_to_world=board_to_world @ inverse(board_to_camera), image_size_px=size_px),
        rms_px,
        float(np.linalg.norm(errors_px, axis=1).max()),
        len(points_m),
        float(np.sqrt(np.trace(spread[3:, 3:]))),
        float(np.sqrt(np.trace(spread[:3, :3]))),
    )


def _one_size(pictures: Sequence[npt.NDArray[np.uint8]]) -> tuple[int, int]:
    sizes = {(picture.shape[1], picture.shape[0]) for picture in pictures}
    if len(sizes) != 1:
        listed = ", ".join(f"{width}x{height}" for width, height in sorted(sizes)) or "none"
        raise InvalidInputError("pictures", f"have the sizes {listed}", "one or more pictures of one size")
    return sizes.pop()


def _seen(pictures: Sequence[npt.NDArray[np.uint8]], board: CharucoBoard) -> tuple[Array, Array]:
    """(N, 3) corners in the board's axes and (N, 2) in the pictures, of all pictures."""
    places: list[Array] = []
    all_ids: list[npt.NDArray[np.int64]] = []
    first: dict[int, Array] = {}
    for index, picture in enumerate(pictures):
        corners_px, ids, markers = board.find(picture)
        _check_seen(f"pictures[{index}]", ids, markers, board)
        for id_, corner in zip(ids.tolist(), corners_px, strict=True):
            moved_px = float(np.linalg.norm(corner - first.setdefault(id_, corner)))
            if moved_px > MAX_MOTION_PX:
                message = f"a corner of the board is {moved_px:.1f} px from where an earlier picture has it"
                raise InvalidInputError(f"pictures[{index}]", message, "camera and board at rest")
        places.append(corners_px)
        all_ids.append(ids)
    return board.corners_m[np.concatenate(all_ids)], np.concatenate(places)


def _check_seen(where: str, ids: npt.NDArray[np.int64], markers: int, board: CharucoBoard) -> None:
    inner = board.columns - 1
    spread = len(set(ids % inner)) > 1 and len(set(ids // inner)) > 1
    if len(ids) >= MIN_CORNERS and spread:
        return
    message = f"shows {len(ids)} corners and {markers} markers of the board"
    remedy = f"at least {MIN_CORNERS} corners, not all in one row"
    if markers >= MIN_CORNERS:
        remedy += "; so many markers fit another board: check columns, rows and the legacy pattern"
    raise InvalidInputError(where, message, remedy)


def _board_to_camera(points_m: Array, corners_px: Array, matrix: Array) -> tuple[Array, Array]:
    """Rotation vector and shift; a flat board may leave two, of which the far better one is taken."""
    _, turns, shifts, _ = cv2.solvePnPGeneric(points_m, corners_px, matrix, None, flags=cv2.SOLVEPNP_IPPE)
    refined = [
        cv2.solvePnPRefineLM(points_m, corners_px, matrix, None, turn, shift)
        for turn, shift in zip(turns, shifts, strict=True)
    ]
    poses = [(np.asarray(turn, np.float64), np.asarray(shift, np.float64)) for turn, shift in refined]
    poses.sort(key=lambda pose: _rms(_errors(points_m, corners_px, matrix, *pose)[0]))
    best, *rest = poses
    for other in rest:
        apart_rad = np.linalg.norm(cv2.Rodrigues(cv2.Rodrigues(best[0])[0].T @ cv2.Rodrigues(other[0])[0])[0])
        errors = [_rms(_errors(points_m, corners_px, matrix, *pose)[0]) for pose in (best, other)]
        if apart_rad > RIVAL_RAD and errors[1] < RIVAL_ERROR * errors[0]:
            message = f"two poses of the board, {np.degrees(apart_rad):.0f} degrees apart, fit about as well"
            raise InvalidInputError("pictures", message, "a board that is nearer, larger or seen more from the side")
    return best


def _errors(points_m: Array, corners_px: Array, matrix: Array, turn: Array, shift: Array) -> tuple[Array, Array]:
    """(N, 2) errors and their slopes (2 N, 6) by rotation vector and shift."""
    projected, slopes = cv2.projectPoints(points_m, turn, shift, matrix, None)
    return np.asarray(projected, np.float64).reshape(-1, 2) - corners_px, np.asarray(slopes, np.float64)[:, :6]


def _rms(errors_px: Array) -> float:
    return float(np.sqrt((errors_px**2).sum(axis=1).mean()))
