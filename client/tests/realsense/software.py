"""A camera of librealsense's own `software_device`, which sends the pictures that it is given."""

import threading
import time

import numpy as np
import pyrealsense2 as rs

BASELINE_M = 0.015  # of the color camera from the depth camera, along x


class SoftwareRealSense:
    """Streams depth and color in a thread of its own.

    Args:
        shoot: returns ((H, W, 3) uint8, (H, W) uint16) of each moment; raises StopIteration: the cable is pulled.
        clock_off_s: what the camera's clock is ahead of this computer's.
    """

    def __init__(
        self, shoot, fx_px=600.0, size_px=(640, 480), depth_scale=0.001, clock_off_s=0.0, coeffs=(0.0,) * 5, rate_hz=60
    ):
        self.device = rs.software_device()
        self._period_s = 1 / rate_hz
        self._shoot, self._clock_off_s, self._scale = shoot, clock_off_s, depth_scale
        self._color, color = self._sensor("Color", rs.stream.color, rs.format.rgb8, 3, fx_px, size_px, coeffs)
        self._depth, depth = self._sensor("Depth", rs.stream.depth, rs.format.z16, 2, fx_px, size_px, (0.0,) * 5)
        self._depth.add_read_only_option(rs.option.depth_units, depth_scale)
        between = rs.extrinsics()
        between.rotation, between.translation = np.eye(3).ravel().tolist(), [-BASELINE_M, 0.0, 0.0]
        depth.register_extrinsics_to(color, between)
        self.device.create_matcher(rs.matchers.default)
        self._profiles = (depth, color)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()

    def _sensor(self, name, stream, form, bytes_per_pixel, fx_px, size_px, coeffs):
        k = rs.intrinsics()
        (k.width, k.height), k.fx, k.fy = size_px, fx_px, fx_px
        k.ppx, k.ppy = (size_px[0] - 1) / 2, (size_px[1] - 1) / 2
        k.model, k.coeffs = rs.distortion.brown_conrady, list(coeffs)
        video = rs.video_stream()
        video.type, video.index, video.uid, video.fmt = stream, 0, int(stream), form
        video.width, video.height, video.fps, video.bpp, video.intrinsics = *size_px, 30, bytes_per_pixel, k
        sensor = self.device.add_sensor(name)
        return sensor, sensor.add_video_stream(video)

    def _run(self):
        number = 0
        while not self._ended.wait(self._period_s):
            number += 1
            taken_ms = 1000 * (time.time() + self._clock_off_s)
            try:
                rgb, units = self._shoot()
            except StopIteration:
                return
            for sensor, profile, image in zip((self._depth, self._color), self._profiles, (units, rgb), strict=True):
                frame = rs.software_video_frame()
                frame.bpp = image.itemsize * (image.shape[2] if image.ndim == 3 else 1)
                frame.stride = frame.bpp * image.shape[1]
                frame.timestamp, frame.domain, frame.frame_number = taken_ms, rs.timestamp_domain.global_time, number
                frame.profile, frame.pixels = profile.as_video_stream_profile(), np.ascontiguousarray(image)
                if image.ndim == 2:
                    frame.depth_units = self._scale
                sensor.on_video_frame(frame)
