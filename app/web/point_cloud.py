"""What a camera with color and depth saw, as points for `static/points3d.js`."""

import numpy as np

from app.services.setting_parts import WorkspaceSettings
from roboprompt_client.camera import RgbdFrame

MAX_POINTS = 30_000
AROUND_M = 0.3  # beyond the workspace, on each side: the room behind it is left out


def point_cloud(frame: RgbdFrame, workspace: WorkspaceSettings) -> bytes:
    """N points in and around the workspace, at most MAX_POINTS, evenly of all that there are.

    Returns:
        (N, 3) little-endian float32 x y z in meters, world frame; after them (N, 3) uint8 red, green, blue.
    """
    assert frame.depth_m is not None, "the camera has depth"
    assert frame.rgb is not None, "the camera has color"
    rows, columns = np.nonzero(frame.depth_m > 0)
    points = frame.camera.deproject(rows, columns, frame.depth_m[rows, columns])
    low, high = np.array(workspace.min) - AROUND_M, np.array(workspace.max) + AROUND_M
    kept = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    if len(kept) > MAX_POINTS:
        kept = np.random.default_rng(0).choice(kept, MAX_POINTS, replace=False)
    colors = frame.rgb[rows[kept], columns[kept]]
    return points[kept].astype("<f4").tobytes() + colors.astype(np.uint8).tobytes()
