"""Driver of Intel RealSense cameras: depth aligned to color, factory intrinsics and depth scale, no filters.

In a cell's file:

{"name": "front", "driver": "realsense", "options": {"serial": "819612070593"}}
"""

import time
from typing import Any

import numpy as np

from roboprompt_client.cameras.rig import Intrinsics, Picture
from roboprompt_client.errors import CameraError
from roboprompt_client.extras import import_extra

WARM_UP_FRAMES = 30  # for the automatic exposure, 1 s at 30 Hz
MAX_WAIT_S = 2.0  # for a frame
MAX_LATE_FRAMES = 60  # frames taken before the call that are skipped


class RealSense:
    """One camera, which streams until it is closed.

    Args:
        serial: as printed on the camera; None: the only camera that is plugged in.
        width_px, height_px, frame_rate_hz: of color and depth.
        device: a device of pyrealsense2, instead of one that is plugged in.

    Raises:
        CameraError: if the camera is missing, or lacks a stream of this size and rate.
        InvalidInputError: if pyrealsense2 is not installed.
    """

    def __init__(
        self,
        serial: str | None = None,
        width_px: int = 640,
        height_px: int = 480,
        frame_rate_hz: int = 30,
        device: Any = None,  # noqa: ANN401
    ) -> None:
        self._rs = rs = import_extra("pyrealsense2", "pyrealsense2 (on Debian with libusb-1.0-0)", "realsense")
        self._mode = (width_px, height_px, frame_rate_hz)
        self._device = _plugged_in(rs, serial) if device is None else device
        self._streams = rs.syncer()
        self._align = rs.align(rs.stream.color)
        self._started: list[Any] = []
        self._settled = False
        try:
            self._start()
        except RuntimeError as error:
            self.close()
            raise CameraError(f"does not stream: {error}", "the camera on USB 3, used by this program alone") from error

    def read(self) -> Picture:
        for _ in range(0 if self._settled else WARM_UP_FRAMES):
            self._frames()
        self._settled = True
        asked_s = time.time()
        for _ in range(MAX_LATE_FRAMES):
            depth, color = self._frames()
            taken_s = self._taken_s(color)
            if taken_s >= asked_s:
                return self._picture(depth, color, taken_s)
        late_s = time.time() - taken_s
        raise CameraError(f"its frames are {late_s:.1f} s old: its clock is off", "the camera plugged in anew")

    def close(self) -> None:
        for sensor in self._started:
            sensor.stop()
            sensor.close()
        self._started = []

    def _start(self) -> None:
        """Start the depth and color streams, of two sensors or of one that has both (D405)."""
        rs = self._rs
        wanted = {(rs.stream.depth, rs.format.z16), (rs.stream.color, rs.format.rgb8)}
        for sensor in self._device.query_sensors():
            fitting = [profile for profile in sensor.get_stream_profiles() if self._fits(profile, wanted)]
            chosen = {(profile.stream_type(), profile.format()): profile for profile in fitting}
            wanted -= chosen.keys()
            if not chosen:
                continue
            for option in (rs.option.global_time_enabled, rs.option.enable_auto_exposure):
                if sensor.supports(option) and not sensor.is_option_read_only(option):
                    sensor.set_option(option, 1)
            sensor.open(list(chosen.values()))
            sensor.start(self._streams)
            self._started.append(sensor)
        if wanted:
            missing = " and ".join(sorted(str(stream).rpartition(".")[2] for stream, _ in wanted))
            mode = "{}x{} at {} Hz".format(*self._mode)
            raise CameraError(f"has no {missing} of {mode}", "a mode that `rs-enumerate-devices` lists")

    def _fits(self, profile: Any, wanted: set[Any]) -> bool:  # noqa: ANN401
        if (profile.stream_type(), profile.format()) not in wanted:
            return False
        video = profile.as_video_stream_profile()
        return bool((video.width(), video.height(), video.fps()) == self._mode)

    def _frames(self) -> tuple[Any, Any]:
        """Return the next depth and color frames of one moment, depth aligned to color."""
        end_s = time.monotonic() + MAX_WAIT_S
        while time.monotonic() < end_s:
            try:
                frames = self._streams.wait_for_frames(round(1000 * MAX_WAIT_S))
            except RuntimeError:
                break
            if frames.get_depth_frame() and frames.get_color_frame():
                aligned = self._align.process(frames)
                return aligned.get_depth_frame(), aligned.get_color_frame()
        gone = "was unplugged" if not self._device.is_connected() else f"sent no pair of frames within {MAX_WAIT_S:g} s"
        raise CameraError(gone, "its cable, a USB 3 port, no other program that uses it")

    def _taken_s(self, frame: Any) -> float:  # noqa: ANN401
        """Return a frame's time by this computer's clock; if the camera does not report it, the time of arrival."""
        hardware = self._rs.timestamp_domain.hardware_clock
        return time.time() if frame.get_frame_timestamp_domain() == hardware else float(frame.get_timestamp()) / 1000

    def _picture(self, depth: Any, color: Any, taken_s: float) -> Picture:  # noqa: ANN401
        k = color.get_profile().as_video_stream_profile().intrinsics
        scale = float(depth.get_units())
        rgb = np.array(color.get_data(), np.uint8)
        depth_m = np.asarray(depth.get_data()).astype(np.float32) * np.float32(scale)
        intrinsics = Intrinsics(k.fx, k.fy, k.ppx, k.ppy, k.width, k.height)
        return Picture(rgb, depth_m, intrinsics, taken_s, scale).undistorted(k.coeffs)


def _plugged_in(rs: Any, serial: str | None) -> Any:  # noqa: ANN401
    devices = {device.get_info(rs.camera_info.serial_number): device for device in rs.context().query_devices()}
    found = ", ".join(devices) or "none"
    if serial is None and len(devices) == 1:
        return next(iter(devices.values()))
    if serial not in devices:
        raise CameraError(f"no RealSense {serial or 'without a serial'} is plugged in", f"the serial of one: {found}")
    return devices[serial]
