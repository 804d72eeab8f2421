"""A cell's cameras: what a driver offers, and pictures that become calibrated frames, or an error names the camera."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from roboprompt_client.cameras.table import Table
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.extras import import_extra
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, RgbdFrame

INTRINSICS = '{"fx": .., "fy": .., "cx": .., "cy": .., "width": .., "height": ..}, pixels'
MAX_UNKNOWN_DEPTH = 0.5  # share of pixels
MAX_SKEW_S = 0.25  # of a camera's clock against this computer's
# Of the hand while its camera takes a picture; at 0.5 m this shifts an object by 2 mm at most.
MAX_HAND_MOTION_M, MAX_HAND_TURN_RAD = 0.001, 0.002
SETTLE_S = 0.3  # after a motion, because arms swing a little
HandPose = Callable[[], Array]


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera's intrinsics and image size. Pixel centers are whole numbers."""

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    width_px: int
    height_px: int

    @property
    def matrix(self) -> Array:
        """OpenCV's camera matrix (3, 3)."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1]])

    @classmethod
    def from_json(cls, field: str, document: object) -> "Intrinsics":
        """Return the intrinsics of a JSON object; raises InvalidInputError naming `field`."""
        try:
            k: Mapping[str, Any] = document  # type: ignore[assignment]
            fx, fy, cx, cy = (float(k[name]) for name in ("fx", "fy", "cx", "cy"))
            return cls(fx, fy, cx, cy, int(k["width"]), int(k["height"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(field, f"are {document!r:.120}", INTRINSICS) from error


@dataclass(frozen=True, eq=False)
class Picture:
    """One camera's picture of one moment, without lens distortion.

    Attributes:
        rgb: (H, W, 3) uint8, red first.
        depth_m: (H, W) float32 meters along the color camera's optical axis, 0 where unknown; None without depth.
        taken_s: seconds since 1970, by this computer's clock.
        depth_scale: meters per unit of the camera's own depth images.
    """

    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32] | None
    intrinsics: Intrinsics
    taken_s: float
    depth_scale: float = 0.001

    def undistorted(self, distortion: Sequence[float]) -> "Picture":
        """Return the picture without lens distortion, OpenCV's k1 k2 p1 p2 [k3 ...]; the intrinsics stay.

        Raises InvalidInputError if OpenCV is needed, because one of them is not 0, and not installed.
        """
        if not any(distortion):
            return self
        cv2 = import_extra("cv2", "opencv-python-headless", "images")
        matrix, size_px = self.intrinsics.matrix, (self.intrinsics.width_px, self.intrinsics.height_px)
        maps = cv2.initUndistortRectifyMap(matrix, np.array(distortion, float), None, matrix, size_px, cv2.CV_32FC1)
        rgb = cv2.remap(self.rgb, *maps, cv2.INTER_LINEAR)
        # interpolating depth between two surfaces would give points on neither
        depth_m = None if self.depth_m is None else cv2.remap(self.depth_m, *maps, cv2.INTER_NEAREST)
        return replace(self, rgb=rgb, depth_m=depth_m)


class CameraDriver(Protocol):
    """A kind of camera. `read` is called while arm and scene rest."""

    def read(self) -> Picture:
        """Return a picture that is taken after the call.

        Raises:
            CameraError: if there is none (unplugged, too slow, no frame); the caller adds the camera's name.
        """

    def close(self) -> None:
        """Disconnect."""


@dataclass(frozen=True, eq=False)
class MountedCamera:
    """A camera of the cell.

    Attributes:
        in_hand: whether the hand carries it.
        mount: (4, 4) `camera_to_hand` if the hand carries it, else `camera_to_world`; None: not calibrated yet.
    """

    name: str
    driver: CameraDriver
    in_hand: bool = False
    mount: Array | None = None

    def calibrated(self, picture: Picture, hand_to_world: Array | None) -> RgbdFrame:
        """Return the picture as a frame with its camera's pose in the world.

        A camera in the hand needs `hand_to_world` (4, 4) at the time of the picture. Raises InvalidInputError if the
        camera is not calibrated, or picture and intrinsics do not fit.
        """
        if self.mount is None:
            field = f"cameras[{self.name}].camera_to_{'hand' if self.in_hand else 'world'}"
            raise InvalidInputError(field, "is not known", "a pose: `roboprompt-robot calibrate` finds it")
        pose, k = self.mount, picture.intrinsics
        if self.in_hand:
            assert hand_to_world is not None
            pose = hand_to_world @ self.mount
        numbers = (k.fx_px, k.fy_px, k.cx_px, k.cy_px)
        camera = Camera(self.name, *numbers, pose, picture.depth_scale, (k.width_px, k.height_px))
        return RgbdFrame(camera, picture.rgb, picture.depth_m)


class Rig:
    """The cell's cameras, and the table's plane when they were calibrated, if it was remembered.

    Raises InvalidInputError for two cameras with one name.
    """

    def __init__(self, cameras: Iterable[MountedCamera] = (), table: Table | None = None) -> None:
        self.cameras, self.table = tuple(cameras), table
        names = [camera.name for camera in self.cameras]
        if twice := [name for name in names if names.count(name) > 1]:
            raise InvalidInputError("cameras", f"{twice[0]!r} appears twice", "each camera once")
        self._last: dict[str, bytes] = {}

    def close(self) -> None:
        """Disconnect from all cameras."""
        for camera in self.cameras:
            camera.driver.close()

    def frames(self, hand: HandPose | None = None) -> tuple[RgbdFrame, ...]:
        """Return what the cameras see now; those in the hand need `hand`, which returns its pose (4, 4) in the world.

        Raises:
            CameraError: naming the camera whose picture is missing, old, frozen, without depth, or taken in motion.
            InvalidInputError: if a camera is not calibrated.
        """
        return tuple(camera.calibrated(*self.picture(camera, hand)) for camera in self.cameras)

    def picture(self, camera: MountedCamera, hand: HandPose | None = None) -> tuple[Picture, Array | None]:
        """Return a camera's picture, and the hand's pose (4, 4) at that time (None for a camera that stands still)."""
        if camera.in_hand and hand is None:
            raise CameraError("is in the hand", "an arm that says where its hand is", camera.name)
        before = hand() if camera.in_hand and hand is not None else None
        asked_s = time.time()
        try:
            picture = camera.driver.read()
            self._check(camera.name, picture, asked_s)
        except CameraError as error:
            raise error.of(camera.name) from error
        if before is not None and hand is not None:
            check_rest(camera.name, before, hand())
        return picture, before

    def _check(self, name: str, picture: Picture, asked_s: float) -> None:
        early_s, late_s = asked_s - picture.taken_s, picture.taken_s - time.time()
        if early_s > MAX_SKEW_S:
            what = f"its picture was taken {early_s:.2f} s before it was asked for: a queue, or a clock that is off"
            raise CameraError(what, f"at most {MAX_SKEW_S:g} s")
        if late_s > MAX_SKEW_S:
            raise CameraError(f"its clock is {late_s:.2f} s ahead of this computer's", f"at most {MAX_SKEW_S:g} s")
        depth = b"" if picture.depth_m is None else np.ascontiguousarray(picture.depth_m).tobytes()
        digest = blake2b(np.ascontiguousarray(picture.rgb).tobytes() + depth).digest()
        if self._last.get(name) == digest:
            remedy = "a camera that streams: two pictures of a sensor are never equal"
            raise CameraError("its picture is frozen: the last one again, byte for byte", remedy)
        self._last[name] = digest
        if picture.depth_m is not None and (unknown := float(np.mean(picture.depth_m <= 0))) > MAX_UNKNOWN_DEPTH:
            remedy = f"at most {MAX_UNKNOWN_DEPTH:.0%}: nothing nearer than the camera measures, and a clean lens"
            raise CameraError(f"the depth of {unknown:.0%} of its pixels is unknown", remedy)


def check_rest(name: str, before: Array, after: Array) -> None:
    """Raise CameraError if the hand moved between two poses (4, 4), before and after a camera's picture."""
    moved_m = float(np.linalg.norm(after[:3, 3] - before[:3, 3]))
    cosine = (np.trace(before[:3, :3].T @ after[:3, :3]) - 1) / 2
    turned_rad = float(np.arccos(np.clip(cosine, -1, 1)))
    if moved_m > MAX_HAND_MOTION_M or turned_rad > MAX_HAND_TURN_RAD:
        what = f"the hand moved by {1000 * moved_m:.1f} mm and {np.degrees(turned_rad):.2f} degrees during its picture"
        raise CameraError(what, "a hand at rest", name)
