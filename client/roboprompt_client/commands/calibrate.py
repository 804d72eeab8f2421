"""`roboprompt-robot calibrate`: where the cell's cameras are, from pictures of a ChArUco board at poses of the hand."""

import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roboprompt_client.arms.arm import Arm
from roboprompt_client.cameras.picture import Intrinsics
from roboprompt_client.cameras.rig import SETTLE_S, MountedCamera, check_rest
from roboprompt_client.cell import read_cell, write_cell
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.look import CELL, AddCommand, seeing_arm
from roboprompt_client.commands.terminal import ask, ask_yes, in_columns, say
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import import_extra
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import Pose

if TYPE_CHECKING:  # OpenCV and scipy are extras
    from roboprompt_client.calibration.board import CharucoBoard
    from roboprompt_client.calibration.bundle import FittedCamera, Sighting

MOTION_DEG, MOTION_M = 22.0, 0.05  # of the proposed poses around where the hand is
PROPOSED = 14
COLUMNS = ("camera", "poses", "corners off", "board off, in the median", "what to do")


def add_calibrate(add: AddCommand) -> None:
    """Add `calibrate` to the script's commands."""
    what = "find where the cell's cameras are, by a ChArUco board in the hand, or before cameras that the hand carries"
    calibrate = add("calibrate", what, run_calibrate)
    calibrate.add_argument("--robot", required=True, metavar="CELL", help=CELL)
    calibrate.add_argument("--carried", action="store_true", help="those in the hand; the board lies still")
    calibrate.add_argument("--by-hand", action="store_true", help="you guide the arm; it does not move")
    calibrate.add_argument("--columns", type=int, default=5, help="squares of the board (default: %(default)s)")
    calibrate.add_argument("--rows", type=int, default=7, help="squares of the board (default: %(default)s)")
    calibrate.add_argument("--square", type=float, default=0.035, metavar="M", help="side (default: %(default)s)")
    calibrate.add_argument("--marker", type=float, default=0.026, metavar="M", help="side (default: %(default)s)")
    calibrate.add_argument("--dictionary", default="DICT_5X5_100", help="family of markers (default: %(default)s)")
    calibrate.add_argument("--legacy", action="store_true", help="the pattern that OpenCV drew before 4.6")


def run_calibrate(_: RoboPromptClient, arguments: Namespace) -> int:
    """Visit poses, fit, print the errors, write the cell's file; 1 where an error is large or nothing is written."""
    import_extra("cv2", "opencv-python-headless", "calibrate")
    import_extra("scipy", "scipy", "calibrate")
    from roboprompt_client.calibration.board import CharucoBoard
    from roboprompt_client.calibration.bundle import fit_cameras

    sides = (arguments.square, arguments.marker)
    board = CharucoBoard(arguments.columns, arguments.rows, *sides, arguments.dictionary, arguments.legacy)
    path = Path(arguments.robot)
    read_cell(path)
    with seeing_arm(arguments.robot) as arm:
        assert arm.cameras is not None
        cameras = [camera for camera in arm.cameras.cameras if camera.in_hand == arguments.carried]
        if not cameras:
            remedy = "--carried for cameras with camera_to_hand; without it those with camera_to_world"
            raise InvalidInputError("cameras", "none of this kind are in the cell's file", remedy)
        sightings, intrinsics = _sightings(arm, cameras, board, by_hand=arguments.by_hand)
    if not sightings:
        raise InvalidInputError("cameras", "saw the board nowhere", "a pose at which they see the whole board")
    fitted = fit_cameras(sightings, intrinsics, carried=arguments.carried)
    say(in_columns([COLUMNS, *(_row(name, item) for name, item in fitted.items())]))
    if not ask_yes(f"Write these poses into {path}? [y/N] "):
        return 1
    _write(path, fitted, "camera_to_hand" if arguments.carried else "camera_to_world")
    return int(any(item.advice for item in fitted.values()))


def _sightings(
    arm: Arm, cameras: Sequence[MountedCamera], board: "CharucoBoard", *, by_hand: bool
) -> tuple[list["Sighting"], dict[str, Intrinsics]]:
    """What the cameras saw of the board at each pose, and their intrinsics."""
    from roboprompt_client.calibration.board import check_seen
    from roboprompt_client.calibration.bundle import Sighting

    assert arm.cameras is not None
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
    """Numbers of poses to which the person guides the arm."""
    number = 1
    what = "tilted otherwise than before. Enter: picture, q: done "
    while ask(f"Guide the hand to pose {number}, {what}") not in ("q", None):
        yield number
        number += 1


def _visited(arm: Arm) -> Iterator[int]:
    """Numbers of poses to which the arm goes by itself, each of them allowed by the person."""
    number = 0
    for pose in _proposed(arm.hand_to_world()):
        if problem := arm.problem_with(pose):
            say(f"  a pose is left out: {problem}")
            continue
        number += 1
        assert arm.confirm_viewpoint is not None
        if not arm.confirm_viewpoint(number, pose):
            continue
        arm.go_to(pose)
        time.sleep(SETTLE_S)
        yield number


def _proposed(hand: Array) -> Iterator[Pose]:
    """Poses around where the hand is, tilted about all its axes."""
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
    return Pose(tuple(hand[:3, 3].tolist()), tuple(rotations.from_matrix(hand[:3, :3]).tolist()))


def _row(name: str, fitted: "FittedCamera") -> tuple[str, ...]:
    off = f"{1000 * fitted.off_m:.1f} mm, {fitted.off_deg:.2f}°"
    return name, str(fitted.num_poses), f"{fitted.rms_px:.2f} px", off, fitted.advice or "nothing: good"


def _write(path: Path, fitted: "dict[str, FittedCamera]", field: str) -> None:
    """Put the poses into the cell's file; what else is in it stays."""
    cell = read_cell(path)
    for camera in cell["cameras"]:
        if camera["name"] in fitted:
            camera[field] = fitted[camera["name"]].mount.tolist()
    write_cell(path, cell)
    say(f"written to {path}; next: roboprompt-robot look --robot {path} --remember")
