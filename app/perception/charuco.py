"""A ChArUco board: a chessboard whose white squares carry markers, so that a part of it is enough."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.perception.marker_model import DICTIONARIES, marker_dictionary
from app.perception.object_model import number, one_of
from app.pipeline.arrays import Array
from app.pipeline.errors import InvalidInputError

MAX_SQUARES = 100  # a side
PRINT_DPI = 300
METRES_PER_INCH = 0.0254
SUBPIX_UNTIL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)


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
        number("square_m", self.square_m, valid="a length in metres", low=1e-4)
        number("marker_m", self.marker_m, valid="a length in metres", low=1e-4)
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
        return corners * (1, -1, -1) + (
            0,
            self.size_m[1],
            0,
        )  # OpenCV begins at the top left, its z goes into the paper

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
