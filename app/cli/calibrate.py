"""`roboprompt calibrate`, `calibration-board`, `teach-objects`: where a camera stands, and what objects look like."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from app.cli.shared import URL_HELP, check_service
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ServiceProblemError, ServiceUnreachableError

Squares = Annotated[int, typer.Option(help="squares of the board", min=3)]
SquareSide = Annotated[float, typer.Option("--square", help="side of a square, meters: measure it on the print")]
MarkerSide = Annotated[float, typer.Option("--marker", help="side of a marker's black border, meters")]
Dictionary = Annotated[str, typer.Option(help="family of the markers, e.g. DICT_5X5_100, DICT_APRILTAG_36h11")]
Legacy = Annotated[bool, typer.Option("--legacy", help="the pattern that OpenCV drew before 4.6")]


def calibrate(
    pictures: Annotated[list[Path], typer.Argument(help="of the board; several of one scene make it more precise")],
    intrinsics: Annotated[
        tuple[float, float, float, float], typer.Option(help="fx fy cx cy in pixels, of undistorted pictures")
    ],
    board_position: Annotated[
        tuple[float, float, float],
        typer.Option(help="the board's bottom left corner in the robot's world frame, meters"),
    ],
    board_quaternion: Annotated[
        tuple[float, float, float, float],
        typer.Option(help="x y z w of the board's axes: x to its right, y to its top, z out of the paper"),
    ] = (0.0, 0.0, 0.0, 1.0),
    name: Annotated[str, typer.Option(help="of the camera, as uploads will call it")] = "front",
    depth_scale: Annotated[float, typer.Option(help="meters per unit of its 16-bit depth images")] = 0.001,
    columns: Squares = 5,
    rows: Squares = 7,
    square_m: SquareSide = 0.035,
    marker_m: MarkerSide = 0.026,
    dictionary: Dictionary = "DICT_5X5_100",
    legacy: Legacy = False,
    max_error: Annotated[float, typer.Option(help="greatest error of the corners, pixels (root mean square)")] = 0.5,
) -> None:
    """Find a camera's pose from a ChArUco board that lies at a known pose.

    Prints the camera as uploads need it, an entry of metadata.cameras, and on stderr how well the board's corners fit.
    """
    import numpy as np

    from app.perception.calibration import calibrate as find_pose
    from app.perception.images import decode_rgb
    from app.pipeline.geometry import rigid
    from roboprompt_client.arrays import unit_quaternions
    from roboprompt_client.calibration.board import CharucoBoard
    from roboprompt_client.camera import Camera, camera_json

    console = Console(stderr=True)
    try:
        board = CharucoBoard(columns, rows, square_m, marker_m, dictionary, legacy)
        camera = Camera(name, *intrinsics, np.eye(4), depth_scale)
        images = [decode_rgb(str(path), path.read_bytes()) for path in pictures]
        board_to_world = rigid(board_position, unit_quaternions("board_quaternion", board_quaternion, (4,)))
        found = find_pose(camera, images, board, board_to_world, max_rms_px=max_error)
    except (InvalidInputError, OSError) as error:
        console.print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    precise = f"{1000 * found.position_sigma_m:.1f} mm and {math.degrees(found.rotation_sigma_rad):.2f} degrees"
    fit = f"{found.rms_px:.2f} px off (rms), {found.max_px:.2f} px at most"
    console.print(f"{found.corners} corners in {len(images)} picture(s): {fit}; precise to {precise}", soft_wrap=True)
    print(json.dumps(camera_json(found.camera)))  # noqa: T201


def calibration_board(
    out: Annotated[Path, typer.Argument(help="PNG file")],
    columns: Squares = 5,
    rows: Squares = 7,
    square_m: SquareSide = 0.035,
    marker_m: MarkerSide = 0.026,
    dictionary: Dictionary = "DICT_5X5_100",
    legacy: Legacy = False,
) -> None:
    """Write the picture of a ChArUco board, to be printed and glued to something flat."""
    import cv2

    from roboprompt_client.calibration.board import PRINT_DPI, CharucoBoard

    try:
        board = CharucoBoard(columns, rows, square_m, marker_m, dictionary, legacy)
        out.write_bytes(cv2.imencode(".png", board.picture())[1].tobytes())
    except (InvalidInputError, OSError) as error:
        Console(stderr=True).print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    size = " x ".join(f"{100 * side_m:.1f}" for side_m in board.size_m)
    print(f"{out}: print it at {PRINT_DPI} dpi, unscaled: the squares then cover {size} cm")  # noqa: T201


def teach_objects(
    task: Annotated[str, typer.Argument(help="a task with labeled episodes: RGB-D images with masks or poses")],
    url: Annotated[str, typer.Option(help=URL_HELP)] = DEFAULT_URL,
    episodes: Annotated[int, typer.Option(min=1, max=100, help="learn from at most so many, the task's first")] = 10,
    objects: Annotated[list[str] | None, typer.Option("--object", help="may be repeated; default: all")] = None,
) -> None:
    """Let the service learn what a task's objects look like; from then on it finds them in images.

    Prints the learned object models as JSON, and of the objects that cannot be learned the reason.
    """
    console = Console(stderr=True)
    check_service(url)
    try:
        with RoboPromptClient(url) as client:
            learned = client.learn_object_models(task, objects, episodes)
    except (ServiceProblemError, ServiceUnreachableError) as error:
        console.print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    for name, reason in learned["refused"].items():
        console.print(f"{name}: {reason}", markup=False, soft_wrap=True)
    print(json.dumps(learned))  # noqa: T201
    if not learned["object_models"]:
        raise typer.Exit(1)
