"""Driver of a folder of frames, recorded or written by another program.

In a cell's file: {"name": "front", "driver": "files", "options": {"folder": "frames"}}. A folder has 0001_color.png (or
.jpg), 0001_depth.png (16 bit), and camera.json: {"intrinsics": {...}, "depth_scale": 0.001}. A frame counts as complete
when its color image exists, so the program must write the depth image first.
"""

import json
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from roboprompt_client.cameras.rig import Intrinsics, Picture
from roboprompt_client.errors import CameraError, InvalidInputError
from roboprompt_client.extras import import_extra

MAX_WAIT_S = 5.0
POLL_S = 0.02
CALIBRATION, COLOR, DEPTH = "camera.json", "_color", "_depth.png"


class FrameFolder:
    """A folder of frames: `read` waits for a frame newer than the call, or takes recorded frames ordered by name.

    Args:
        folder: with `camera.json`.
        recorded: whether the frames are old; each is then read once, as if it were taken at the call.

    Raises:
        InvalidInputError: if the folder has no valid `camera.json`, or OpenCV is not installed.
    """

    def __init__(self, folder: str, *, recorded: bool = False) -> None:
        self._cv2 = import_extra("cv2", "opencv-python-headless", "images")
        self._folder, self._recorded, self._last = Path(folder), recorded, ""
        try:
            document = json.loads((self._folder / CALIBRATION).read_text())
            self._intrinsics = Intrinsics.from_json(f"{CALIBRATION}: intrinsics", document["intrinsics"])
            self._depth_scale = float(document.get("depth_scale", 0.001))
        except InvalidInputError:
            raise
        except (OSError, ValueError, KeyError, TypeError) as error:
            remedy = f"a folder with {CALIBRATION}: intrinsics, depth_scale"
            raise InvalidInputError("folder", f"{folder}: {error!r}", remedy) from error

    def read(self) -> Picture:
        color = self._next() if self._recorded else self._newest(time.time())
        taken_s = time.time() if self._recorded else color.stat().st_mtime
        self._last = color.name
        bgr = self._cv2.imread(str(color), self._cv2.IMREAD_COLOR | self._cv2.IMREAD_IGNORE_ORIENTATION)
        if bgr is None:
            raise CameraError(f"{color} is not an image", "a PNG or JPEG")
        depth = color.with_name(color.stem.removesuffix(COLOR) + DEPTH)
        depth_m = self._depth_m(depth) if depth.exists() else None
        return Picture(np.ascontiguousarray(bgr[..., ::-1]), depth_m, self._intrinsics, taken_s, self._depth_scale)

    def close(self) -> None:
        """Do nothing."""

    def _frames(self) -> list[Path]:
        return sorted(path for end in ("png", "jpg") for path in self._folder.glob(f"*{COLOR}.{end}"))

    def _next(self) -> Path:
        for path in self._frames():
            if path.name > self._last:
                return path
        raise CameraError(f"{self._folder} has no frame after {self._last or 'none'}", "more recorded frames")

    def _newest(self, asked_s: float) -> Path:
        end_s = time.monotonic() + MAX_WAIT_S
        while time.monotonic() < end_s:
            if (frames := self._frames()) and frames[-1].stat().st_mtime >= asked_s:
                return frames[-1]
            time.sleep(POLL_S)
        remedy = 'a program that writes frames; for recorded ones the option "recorded": true'
        raise CameraError(f"no frame came into {self._folder} within {MAX_WAIT_S:g} s", remedy)

    def _depth_m(self, path: Path) -> npt.NDArray[np.float32]:
        units = self._cv2.imread(str(path), self._cv2.IMREAD_UNCHANGED)
        if units is None or units.dtype != np.uint16 or units.ndim != 2:
            raise CameraError(f"{path} is not a depth image", f"a 16-bit PNG in units of {self._depth_scale:g} m")
        return np.asarray(units.astype(np.float32) * self._depth_scale, np.float32)
