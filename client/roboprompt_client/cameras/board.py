"""A ChArUco board: a chessboard with markers in its white squares, so that a part of it can be located.

This package needs OpenCV.
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
MAX_SQUARES = 100  # per side
MIN_LENGTH_M = 1e-4
PRINT_DPI = 300
METERS_PER_INCH = 0.0254
SUBPIX_UNTIL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
MIN_CORNERS = 8
RIVAL_RAD = np.radians(3.0)  # poses that differ by less count as the same
RIVAL_ERROR = 1.5  # a second pose with an error larger by this factor is ruled out


@cache
def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return the dictionary of a name in `DICTIONARIES`."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@dataclass(frozen=True)
class CharucoBoard:
    """A printed board.

    Its frame's origin is the bottom left corner of the squares, x along the bottom edge to the right, y along the left
    edge to the top, z out of the paper. The board is upright when its markers are.

    Attributes:
        columns, rows: numbers of squares.
        square_m, marker_m: sides of a square, and of a marker's black border.
        dictionary: the family of markers, whose ids start at 0.
        legacy: whether it has the pattern of OpenCV before 4.6, which differs for an even number of rows.
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
        """(N, 3) the inner corners in the board's frame, in the order of their ids."""
        corners = np.array(self._opencv().getChessboardCorners(), np.float64).reshape(-1, 3)
        # OpenCV's origin is at the top left, its z points into the paper
        return corners * (1, -1, -1) + (0, self.size_m[1], 0)

    def find(self, rgb: npt.NDArray[np.uint8]) -> tuple[Array, npt.NDArray[np.int64], int]:
        """Find the board in an (H, W, 3) image; return corners (N, 2) in pixels, ids (N,), and number of markers."""
        grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
        options = cv2.aruco.CharucoParameters()
        options.tryRefineMarkers = True
        detector = cv2.aruco.CharucoDetector(self._opencv(), options)
        corners, ids, _, marker_ids = detector.detectBoard(grey)
        markers = np.size(marker_ids) if isinstance(marker_ids, np.ndarray) else 0
        if not isinstance(ids, np.ndarray) or not len(ids):
            return np.zeros((0, 2)), np.zeros(0, np.int64), markers
        corners_px = np.asarray(corners, np.float32).reshape(-1, 2)
        reach_px = max(int(self._gap_px(corners_px)), 2)  # OpenCV's default window would include corners of markers
        cv2.cornerSubPix(grey, corners_px, (reach_px, reach_px), (-1, -1), SUBPIX_UNTIL)
        return corners_px.astype(np.float64), np.asarray(ids, np.int64).ravel(), markers

    def _gap_px(self, corners_px: npt.NDArray[np.float32]) -> float:
        """Return the distance in pixels between a marker and its square's sides."""
        apart_px = np.linalg.norm(corners_px[:, None] - corners_px, axis=2)
        nearest_px = np.sort(apart_px, axis=1)[:, 1:2]
        square_px = float(np.median(nearest_px)) if nearest_px.size else 0.0
        return square_px * (1 - self.marker_m / self.square_m) / 2

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return (H, W) gray values with a margin of half a square, to be printed at `PRINT_DPI` without scaling."""
        square_px = round(self.square_m / METERS_PER_INCH * PRINT_DPI)
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
    """Raise InvalidInputError, naming `where`, for a picture that shows too little of the board."""
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
    """Return the board's rotation vector and translation in the camera's frame.

    A flat board may have two solutions; the better one is returned if the other fits much worse.

    Args:
        points_m: (N, 3) corners in the board's frame.
        corners_px: (N, 2) the same corners in the picture.
        matrix: (3, 3) the camera's matrix.

    Raises:
        InvalidInputError: if two poses fit about equally well.
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
    """Return the root mean square of the lengths of errors (N, 2)."""
    return float(np.sqrt((errors_px**2).sum(axis=1).mean()))
