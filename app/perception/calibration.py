"""Where a camera stands, from pictures of a ChArUco board of known pose.

The board is a chessboard whose white squares carry markers, so that a part of it is enough.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.markers.model import DICTIONARIES, marker_dictionary
from app.perception.markers.view import intrinsic_matrix, rigid_transform
from app.perception.object_model import one_of
from app.pipeline.geometry import inverse
from roboprompt_client.arrays import Array
from roboprompt_client.camera import Camera
from roboprompt_client.errors import InvalidInputError

MAX_SQUARES = 100  # a side
MIN_LENGTH_M = 1e-4
PRINT_DPI = 300
METRES_PER_INCH = 0.0254
SUBPIX_UNTIL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
MIN_CORNERS = 8
MAX_RMS_PX = 0.5  # sharp pictures have 0.1; a focal length that is 20 % off costs no more than 0.6 on a small board
MAX_MOTION_PX = 2.0  # of a corner between pictures; noise moves it by a tenth of that
RIVAL_RAD = np.radians(3.0)  # two poses that differ by less are one
RIVAL_ERROR = 1.5  # a rival whose error is larger by this factor is out of the question


@dataclass(frozen=True)
class CharucoBoard:
    """A board as it was printed.

    Its axes begin at its bottom left corner, where the squares end: x along the bottom edge to the right, y along the
    left edge to the top, z out of the paper. It stands the right way up when its markers do.

    Attributes:
        columns, rows: squares.
        square_m, marker_m: sides of a square, and of a marker's black border.
        dictionary: which family the markers are of, from id 0 upwards.
        legacy: whether it is of the pattern that OpenCV drew before 4.6; differs where `rows` is even.
    """

    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str = "DICT_5X5_100"
    legacy: bool = False

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            one_of(name, getattr(self, name), range(3, MAX_SQUARES + 1))
        for name in ("square_m", "marker_m"):
            if not MIN_LENGTH_M <= getattr(self, name) < math.inf:
                raise InvalidInputError(name, f"is {getattr(self, name)}", "a length in metres")
        if self.marker_m >= self.square_m:
            raise InvalidInputError("marker_m", f"is {self.marker_m}", f"less than the square's {self.square_m}")
        one_of("dictionary", self.dictionary, DICTIONARIES)
        known, needed = len(marker_dictionary(self.dictionary).bytesList), self.columns * self.rows // 2
        if needed > known:
            raise InvalidInputError("dictionary", f"has {known} markers, the board {needed}", "a larger dictionary")

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def corners_m(self) -> Array:
        """(N, 3) the chessboard's inner corners in the board's axes, by id."""
        corners = np.array(self._opencv().getChessboardCorners(), np.float64).reshape(-1, 3)
        # OpenCV begins at the top left, its z goes into the paper
        return corners * (1, -1, -1) + (0, self.size_m[1], 0)

    def find(self, rgb: npt.NDArray[np.uint8]) -> tuple[Array, npt.NDArray[np.int64], int]:
        """What an (H, W, 3) image shows: (N, 2) columns and rows of corners, their (N,) ids, and how many markers."""
        grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
        options = cv2.aruco.CharucoParameters()
        options.tryRefineMarkers = True
        detector = cv2.aruco.CharucoDetector(self._opencv(), options)
        corners, ids, _, marker_ids = detector.detectBoard(grey)
        markers = np.size(marker_ids) if isinstance(marker_ids, np.ndarray) else 0
        if not isinstance(ids, np.ndarray) or not len(ids):
            return np.zeros((0, 2)), np.zeros(0, np.int64), markers
        corners_px = np.asarray(corners, np.float32).reshape(-1, 2)
        reach_px = max(int(self._gap_px(corners_px)), 2)  # OpenCV's own window takes in the markers' corners
        cv2.cornerSubPix(grey, corners_px, (reach_px, reach_px), (-1, -1), SUBPIX_UNTIL)
        return corners_px.astype(np.float64), np.asarray(ids, np.int64).ravel(), markers

    def _gap_px(self, corners_px: npt.NDArray[np.float32]) -> float:
        """How far, in the picture, a marker is from its square's sides."""
        apart_px = np.linalg.norm(corners_px[:, None] - corners_px, axis=2)
        nearest_px = np.sort(apart_px, axis=1)[:, 1:2]
        square_px = float(np.median(nearest_px)) if nearest_px.size else 0.0
        return square_px * (1 - self.marker_m / self.square_m) / 2

    def picture(self) -> npt.NDArray[np.uint8]:
        """(H, W) grey values, to be printed at `PRINT_DPI` without scaling; a rim of half a square around it."""
        square_px = round(self.square_m / METRES_PER_INCH * PRINT_DPI)
        rim_px = square_px // 2
        size_px = self.columns * square_px + 2 * rim_px, self.rows * square_px + 2 * rim_px
        return np.asarray(self._opencv().generateImage(size_px, marginSize=rim_px), np.uint8)

    def _opencv(self) -> cv2.aruco.CharucoBoard:
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows), self.square_m, self.marker_m, marker_dictionary(self.dictionary)
        )
        board.setLegacyPattern(self.legacy)
        return board


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
    turn, shift = _board_to_camera(points_m, corners_px, matrix)
    errors_px, slopes = _errors(points_m, corners_px, matrix, turn, shift)
    rms_px = _rms(errors_px)
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
