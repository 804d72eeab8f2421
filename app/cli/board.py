"""`roboprompt calibration-board`: the board by which cameras are calibrated."""

from pathlib import Path
from typing import Annotated

import cv2
import typer

from app.cli.shared import errors_printed
from roboprompt_client.cameras.board import PRINT_DPI, CharucoBoard


def calibration_board(
    out: Annotated[Path, typer.Argument(help="PNG file")],
    columns: Annotated[int, typer.Option(help="squares of the board", min=3)] = 5,
    rows: Annotated[int, typer.Option(help="squares of the board", min=3)] = 7,
    square_m: Annotated[
        float, typer.Option("--square", help="side of a square, meters: measure it on the print")
    ] = 0.035,
    marker_m: Annotated[float, typer.Option("--marker", help="side of a marker's black border, meters")] = 0.026,
    dictionary: Annotated[
        str, typer.Option(help="family of the markers, e.g. DICT_5X5_100, DICT_APRILTAG_36h11")
    ] = "DICT_5X5_100",
    legacy: Annotated[bool, typer.Option("--legacy", help="the pattern that OpenCV drew before 4.6")] = False,
) -> None:
    """Write the picture of a ChArUco board, to be printed and glued to something flat."""
    with errors_printed():
        board = CharucoBoard(columns, rows, square_m, marker_m, dictionary, legacy)
        out.write_bytes(cv2.imencode(".png", board.picture())[1].tobytes())
    size = " x ".join(f"{100 * side_m:.1f}" for side_m in board.size_m)
    print(f"{out}: print it at {PRINT_DPI} dpi, unscaled: the squares then cover {size} cm")  # noqa: T201
