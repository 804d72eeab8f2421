"""A color camera that OpenCV opens, on USB for example; it has no depth.

In a cell's file:

{"name": "side", "driver": "opencv",
 "options": {"device": 0, "intrinsics": {"fx": 600, "fy": 600, "cx": 320, "cy": 240, "width": 640, "height": 480},
             "distortion": [0.1, -0.2, 0, 0]}}
"""

import time
from collections.abc import Sequence

from roboprompt_client.cameras.picture import Intrinsics, Picture, undistorted
from roboprompt_client.errors import CameraError
from roboprompt_client.extras import import_extra

QUEUED_FRAMES = 5  # that drivers keep: they were taken before the call
WARM_UP_FRAMES = 30


class UsbCamera:
    """One color camera.

    Args:
        device: its number, a path as /dev/video2, or an address that OpenCV opens.
        intrinsics: of the image size that is asked for, as in a camera's JSON.
        distortion: OpenCV's k1 k2 p1 p2 [k3 ...] of the lens; it is removed.

    Raises:
        CameraError: if it cannot be opened.
        InvalidInputError: if the intrinsics are none, or OpenCV is not installed.
    """

    def __init__(self, device: int | str, intrinsics: object, distortion: Sequence[float] = ()) -> None:
        self._cv2 = cv2 = import_extra("cv2", "opencv-python-headless", "images")
        self._intrinsics = k = Intrinsics.from_json("intrinsics", intrinsics)
        self._distortion = tuple(distortion)
        self._capture = cv2.VideoCapture(device)
        if not self._capture.isOpened():
            raise CameraError(f"{device!r} cannot be opened", "a camera that is plugged in and free, as /dev/video0")
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, k.width_px)
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, k.height_px)
        self._pass_over(WARM_UP_FRAMES)

    def read(self) -> Picture:
        self._pass_over(QUEUED_FRAMES)
        taken_s = time.time()
        done, bgr = self._capture.read()
        if not done:
            raise CameraError("sends no frame", "its cable, and no other program that uses it")
        height_px, width_px = bgr.shape[:2]
        if (width_px, height_px) != (self._intrinsics.width_px, self._intrinsics.height_px):
            remedy = "intrinsics of a size that the camera offers"
            raise CameraError(f"sends {width_px}x{height_px} pixels, other than its intrinsics say", remedy)
        rgb = self._cv2.cvtColor(bgr, self._cv2.COLOR_BGR2RGB)
        return undistorted(Picture(rgb, None, self._intrinsics, taken_s), self._distortion)

    def close(self) -> None:
        self._capture.release()

    def _pass_over(self, frames: int) -> None:
        for _ in range(frames):
            self._capture.grab()
