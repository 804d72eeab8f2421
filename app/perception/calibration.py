"""Where a camera stands, from pictures of a ChArUco board of known pose."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from app.perception.markers.view import intrinsic_matrix, rigid_transform
from app.pipeline.geometry import inverse
from roboprompt_client.arrays import Array
from roboprompt_client.calibration.board import CharucoBoard, check_seen, find_board, reprojection, rms_length
from roboprompt_client.camera import Camera
from roboprompt_client.errors import InvalidInputError

MAX_RMS_PX = 0.5  # sharp pictures have 0.1; a focal length that is 20 % off costs no more than 0.6 on a small board
MAX_MOTION_PX = 2.0  # of a corner between pictures; noise moves it by a tenth of that


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
    matrix = intrinsic_matrix(camera)
    turn, shift = find_board(points_m, corners_px, matrix)
    errors_px, slopes = reprojection(points_m, corners_px, matrix, turn, shift)
    rms_px = rms_length(errors_px)
    if rms_px > max_rms_px:
        remedy = "right intrinsics and board measures, and pictures whose lens distortion was removed"
        raise InvalidInputError("pictures", f"corners lie {rms_px:.2f} px off any pose (rms)", remedy)
    board_to_camera = rigid_transform(turn, shift)
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
        check_seen(f"pictures[{index}]", ids, markers, board)
        for id_, corner in zip(ids.tolist(), corners_px, strict=True):
            moved_px = float(np.linalg.norm(corner - first.setdefault(id_, corner)))
            if moved_px > MAX_MOTION_PX:
                message = f"a corner of the board is {moved_px:.1f} px from where an earlier picture has it"
                raise InvalidInputError(f"pictures[{index}]", message, "camera and board at rest")
        places.append(corners_px)
        all_ids.append(ids)
    return board.corners_m[np.concatenate(all_ids)], np.concatenate(places)
