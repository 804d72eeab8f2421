"""`roboprompt-robot calibrate`: find the cameras' poses from pictures of a ChArUco board at several hand poses."""

import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.rig import SETTLE_S, Intrinsics, MountedCamera, check_rest
from roboprompt_client.cell import read_cell, write_cell
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.shared import CELL, AddCommand, ask, ask_yes, in_columns, say, seeing_arm
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import import_extra
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import Pose

if TYPE_CHECKING:  # OpenCV and scipy are extras
    from roboprompt_client.cameras.board import CharucoBoard
    from roboprompt_client.cameras.calibration import FittedCamera, Sighting

MOTION_DEG, MOTION_M = 22.0, 0.05  # of the proposed poses around the hand's first pose
PROPOSED = 14
COLUMNS = ("camera", "poses", "corners off", "board off, in the median", "what to do")


def add_calibrate(add: AddCommand) -> None:
    """Add `calibrate` to the commands."""
    calibrate = add("calibrate", "find the poses of the cell's cameras with a ChArUco board", run_calibrate)
    option = calibrate.add_argument
    option("--robot", required=True, metavar="CELL", help=CELL)
    option("--carried", action="store_true", help="the hand has the cameras (default: the hand has the board)")
    option("--by-hand", action="store_true", help="you guide the arm; it does not move by itself")
    option("--columns", type=int, default=5, help="squares of the board (default: %(default)s)")
    option("--rows", type=int, default=7, help="squares of the board (default: %(default)s)")
    option("--square", type=float, default=0.035, metavar="M", help="side of a square (default: %(default)s)")
    option("--marker", type=float, default=0.026, metavar="M", help="side of a marker (default: %(default)s)")
    option("--dictionary", default="DICT_5X5_100", help="family of markers (default: %(default)s)")
    option("--legacy", action="store_true", help="the board has the pattern of OpenCV before 4.6")


def run_calibrate(_: RoboPromptClient, arguments: Namespace) -> int:
    """Visit poses, fit, print residuals, write the cell's file; return 1 if one is large or nothing is written."""
    import_extra("cv2", "opencv-python-headless", "calibrate")
    import_extra("scipy", "scipy", "calibrate")
    from roboprompt_client.cameras.board import CharucoBoard
    from roboprompt_client.cameras.calibration import fit_cameras

    sides = (arguments.square, arguments.marker)
    board = CharucoBoard(arguments.columns, arguments.rows, *sides, arguments.dictionary, arguments.legacy)
    path = Path(arguments.robot)
    read_cell(path)
    with seeing_arm(arguments.robot) as arm:
        cameras = [camera for camera in arm.cameras.cameras if camera.in_hand == arguments.carried]
        if not cameras:
            remedy = "--carried for cameras with camera_to_hand; without it those with camera_to_world"
            raise InvalidInputError("cameras", "the cell's file has none of this kind", remedy)
        sightings, intrinsics = _sightings(arm, cameras, board, by_hand=arguments.by_hand)
    if not sightings:
        raise InvalidInputError("cameras", "did not see the board", "poses at which they see the whole board")
    fitted = fit_cameras(sightings, intrinsics, carried=arguments.carried)
    say(in_columns([COLUMNS, *(_row(name, item) for name, item in fitted.items())]))
    if not ask_yes(f"Write these poses into {path}? [y/N] "):
        return 1
    _write(path, fitted, "camera_to_hand" if arguments.carried else "camera_to_world")
    return int(any(item.advice for item in fitted.values()))


def _sightings(
    arm: Arm, cameras: Sequence[MountedCamera], board: "CharucoBoard", *, by_hand: bool
) -> tuple[list["Sighting"], dict[str, Intrinsics]]:
    """Return the sightings of the board at all poses, and the intrinsics by camera name."""
    from roboprompt_client.cameras.board import check_seen
    from roboprompt_client.cameras.calibration import Sighting

    found, intrinsics = [], {}
    for number in _guided() if by_hand else _visited(arm):
        for camera in cameras:
            hand = arm.hand_to_world()
            picture, _ = arm.cameras.picture(camera, arm.hand_to_world)
            check_rest(camera.name, hand, arm.hand_to_world())
            intrinsics[camera.name] = picture.intrinsics
            corners_px, ids, markers = board.find(picture.rgb)
            try:
                check_seen(f"pose {number}: {camera.name}", ids, markers, board)
            except InvalidInputError as error:
                say(f"  {error}: left out")
                continue
            found.append(Sighting(camera.name, hand, board.corners_m[ids], corners_px))
            say(f"  pose {number}: {camera.name} sees {len(ids)} corners")
    return found, intrinsics


def _guided() -> Iterator[int]:
    """Let the person guide the arm; yield the number of each pose."""
    number = 1
    what = "with another tilt than before. Enter: picture, q: done "
    while ask(f"Guide the hand to pose {number}, {what}") not in ("q", None):
        yield number
        number += 1


def _visited(arm: Arm) -> Iterator[int]:
    """Move the arm to the proposed poses that the person allows; yield the number of each."""
    number = 0
    for pose in _proposed(arm.hand_to_world()):
        if problem := arm.problem_with(pose):
            say(f"  a pose is left out: {problem}")
            continue
        number += 1
        x_m, y_m, z_m = pose.position_m
        if not ask_yes(f"pose {number}: the hand goes to {x_m:.3f} {y_m:.3f} {z_m:.3f} m. Go? [y/N] "):
            continue
        arm.go_to(pose)
        time.sleep(SETTLE_S)
        yield number


def _proposed(hand: Array) -> Iterator[Pose]:
    """Yield poses around the hand's pose (4, 4), tilted about all its axes."""
    random = np.random.default_rng(0)
    yield _pose(hand)
    for _ in range(PROPOSED - 1):
        tilt = random.uniform(-1, 1, 3)
        tilt *= np.radians(MOTION_DEG) / np.abs(tilt).max()
        moved = hand.copy()
        moved[:3, :3] = hand[:3, :3] @ rotations.to_matrix(rotations.from_rotation_vector(tilt))
        moved[:3, 3] += random.uniform(-MOTION_M, MOTION_M, 3)
        yield _pose(moved)


def _pose(hand: Array) -> Pose:
    return Pose(hand[:3, 3], rotations.from_matrix(hand[:3, :3]))


def _row(name: str, fitted: "FittedCamera") -> tuple[str, ...]:
    off = f"{1000 * fitted.off_m:.1f} mm, {fitted.off_deg:.2f}°"
    return name, str(fitted.num_poses), f"{fitted.rms_px:.2f} px", off, fitted.advice or "nothing: good"


def _write(path: Path, fitted: "dict[str, FittedCamera]", field: str) -> None:
    """Write the poses into the cell's file; its other fields stay."""
    cell = read_cell(path)
    for camera in cell["cameras"]:
        if camera["name"] in fitted:
            camera[field] = fitted[camera["name"]].mount.tolist()
    write_cell(path, cell)
    say(f"written to {path}; next: roboprompt-robot look --robot {path} --remember")
