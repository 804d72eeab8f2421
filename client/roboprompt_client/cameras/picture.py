"""What a camera's driver must offer (`CameraDriver`): pictures with their intrinsics and their time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import import_extra

INTRINSICS = '{"fx": .., "fy": .., "cx": .., "cy": .., "width": .., "height": ..}, pixels'


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
    def matrix(self) -> npt.NDArray[np.float64]:
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


class CameraDriver(Protocol):
    """A kind of camera. `read` is called while arm and scene rest."""

    def read(self) -> Picture:
        """Return a picture that is taken after the call.

        Raises:
            CameraError: if there is none (unplugged, too slow, no frame); the caller adds the camera's name.
        """
        ...

    def close(self) -> None:
        """Disconnect."""
        ...


def undistorted(picture: Picture, distortion: Sequence[float]) -> Picture:
    """Return the picture without lens distortion; the intrinsics stay.

    Args:
        distortion: OpenCV's k1 k2 p1 p2 [k3 ...]; empty or all 0: the picture is returned as it is.

    Raises:
        InvalidInputError: if OpenCV is needed and not installed.
    """
    if not any(distortion):
        return picture
    cv2 = import_extra("cv2", "opencv-python-headless", "images")
    matrix, size_px = picture.intrinsics.matrix, (picture.intrinsics.width_px, picture.intrinsics.height_px)
    maps = cv2.initUndistortRectifyMap(matrix, np.array(distortion, np.float64), None, matrix, size_px, cv2.CV_32FC1)
    rgb = cv2.remap(picture.rgb, *maps, cv2.INTER_LINEAR)
    # interpolating depth between two surfaces would give points on neither
    depth_m = None if picture.depth_m is None else cv2.remap(picture.depth_m, *maps, cv2.INTER_NEAREST)
    return replace(picture, rgb=rgb, depth_m=depth_m)
