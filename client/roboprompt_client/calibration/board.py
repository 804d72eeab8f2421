"""A ChArUco board: a chessboard whose white squares carry markers, so that a part of it is enough.

Needs OpenCV, as the rest of this room does.
"""

import math
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array

DICTIONARIES = tuple(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
MAX_SQUARES = 100  # a side
MIN_LENGTH_M = 1e-4
PRINT_DPI = 300
METRES_PER_INCH = 0.0254
SUBPIX_UNTIL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
MIN_CORNERS = 8
RIVAL_RAD = np.radians(3.0)  # two poses that differ by less are one
RIVAL_ERROR = 1.5  # a rival whose error is larger by this factor is out of the question


@cache
def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """The dictionary of that name in `DICTIONARIES`."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


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
            if (squares := getattr(self, name)) not in range(3, MAX_SQUARES + 1):
                raise InvalidInputError(name, f"is {squares!r}", f"3 to {MAX_SQUARES}")
        for name in ("square_m", "marker_m"):
            if not MIN_LENGTH_M <= getattr(self, name) < math.inf:
                raise InvalidInputError(name, f"is {getattr(self, name)}", "a length in meters")
        if self.marker_m >= self.square_m:
            raise InvalidInputError("marker_m", f"is {self.marker_m}", f"less than the square's {self.square_m}")
        if self.dictionary not in DICTIONARIES:
            raise InvalidInputError("dictionary", f"is {self.dictionary!r}", ", ".join(DICTIONARIES))
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


def check_seen(where: str, ids: npt.NDArray[np.int64], markers: int, board: CharucoBoard) -> None:
    """Refuse a picture that shows too little of the board; raises InvalidInputError naming `where`."""
    inner = board.columns - 1
    spread = len(set(ids % inner)) > 1 and len(set(ids // inner)) > 1
    if len(ids) >= MIN_CORNERS and spread:
        return
    message = f"shows {len(ids)} corners and {markers} markers of the board"
    remedy = f"at least {MIN_CORNERS} corners, not all in one row"
    if markers >= MIN_CORNERS:
        remedy += "; so many markers fit another board: check columns, rows and the legacy pattern"
    raise InvalidInputError(where, message, remedy)


def find_board(points_m: Array, corners_px: Array, matrix: Array) -> tuple[Array, Array]:
    """Rotation vector and shift; a flat board may leave two, of which the far better one is taken.

    Args:
        points_m: (N, 3) in the board's axes.
        corners_px: (N, 2).
        matrix: (3, 3) of the camera.

    Raises:
        InvalidInputError: if two poses fit about as well.
    """
    _, turns, shifts, _ = cv2.solvePnPGeneric(points_m, corners_px, matrix, None, flags=cv2.SOLVEPNP_IPPE)
    refined = [
        cv2.solvePnPRefineLM(points_m, corners_px, matrix, None, turn, shift)
        for turn, shift in zip(turns, shifts, strict=True)
    ]
    poses = [(np.asarray(turn, np.float64), np.asarray(shift, np.float64)) for turn, shift in refined]
    seen_px = [cv2.projectPoints(points_m, *pose, matrix, None)[0].reshape(-1, 2) for pose in poses]
    errors_px = [rms_length(np.asarray(pixels, np.float64) - corners_px) for pixels in seen_px]
    first, *rest = np.argsort(errors_px).tolist()
    best = poses[int(first)]
    for number in rest:
        apart_rad = np.linalg.norm(cv2.Rodrigues(cv2.Rodrigues(best[0])[0].T @ cv2.Rodrigues(poses[number][0])[0])[0])
        if apart_rad > RIVAL_RAD and errors_px[number] < RIVAL_ERROR * errors_px[first]:
            message = f"two poses of the board, {np.degrees(apart_rad):.0f} degrees apart, fit about as well"
            raise InvalidInputError("pictures", message, "a board that is nearer, larger or seen more from the side")
    return best


def rms_length(errors_px: Array) -> float:
    """Root mean square of the lengths of errors (N, 2)."""
    return float(np.sqrt((errors_px**2).sum(axis=1).mean()))
