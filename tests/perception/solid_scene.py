"""Pictures of upright boxes and cylinders on a table, by casting rays; with the noise of a depth camera."""

from dataclasses import dataclass

import numpy as np

from app.perception.base import ObjectQuery
from roboprompt_client.types.camera import RgbdFrame
from synthetic.camera_noise import as_a_camera_sees_it
from tests.perception.flat_scene import HEIGHT_PX, WIDTH_PX, camera

TABLE_RGB = (190, 170, 140)
RGB = {
    "red": (210, 30, 30),
    "blue": (30, 50, 210),
    "green": (30, 160, 40),
    "yellow": (230, 200, 20),
    "grey": (110,) * 3,
}
SHADES = (0.75, 0.6, 1.0)  # of faces across x, y, z
FRONT, LEFT = camera(), camera("left", (-0.5, 0.6, 0.8), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Solid:
    color: str
    position_m: tuple[float, float, float]
    yaw_rad: float = 0.0
    size_m: tuple[float, float, float] = (0.05, 0.05, 0.05)
    round: bool = False

    @property
    def quaternion_xyzw(self):
        return (0.0, 0.0, np.sin(self.yaw_rad / 2), np.cos(self.yaw_rad / 2))


def cube(color, x_m, y_m, yaw_rad=0.0, storey=0):
    return Solid(color, (x_m, y_m, 0.025 + 0.05 * storey), yaw_rad)


def shoot(solids, view=FRONT, seed=0, noise=True):
    """A frame of the solids on the table z = 0; mask ids are their numbers from 1."""
    rows, columns = np.mgrid[:HEIGHT_PX, :WIDTH_PX].reshape(2, -1)
    local = np.stack(
        [(columns - view.cx_px) / view.fx_px, (rows - view.cy_px) / view.fy_px, np.ones(len(rows))], axis=1
    )
    rays, eye = local @ view.camera_to_world[:3, :3].T, view.camera_to_world[:3, 3]
    depth = -eye[2] / rays[:, 2]
    rgb, mask = np.tile(np.array(TABLE_RGB, float), (len(rays), 1)), np.zeros(len(rays), np.int32)
    for number, solid in enumerate(solids, 1):
        entry, shade = _enter(solid, eye, rays)
        nearer = entry < depth
        depth[nearer], mask[nearer] = entry[nearer], number
        rgb[nearer] = np.array(RGB[solid.color]) * shade[nearer, None]
    shape = (HEIGHT_PX, WIDTH_PX)
    frame = RgbdFrame(
        view,
        rgb.reshape(*shape, 3).astype(np.uint8),
        depth.reshape(shape).astype(np.float32),
        mask.reshape(shape),
    )
    return as_a_camera_sees_it(frame, np.random.default_rng(seed)) if noise else frame


def _enter(solid, eye, rays):
    """Depth (N,) at which rays enter, inf where they miss, and the shade of the face."""
    cos, sin = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    start, along = turn @ (eye - solid.position_m), rays @ turn.T
    half = np.array(solid.size_m) / 2
    # By axis, (3, N): the least of each row of three takes much longer.
    to, at, size = np.ascontiguousarray(along.T), start[:, None], half[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (-at - np.sign(to) * size) / to, (-at + np.sign(to) * size) / to
        if solid.round:
            a, b = (along[:, :2] ** 2).sum(axis=1), along[:, :2] @ start[:2]
            root = np.sqrt(b**2 - a * (start[:2] @ start[:2] - half[0] ** 2))
            near[:2], far[:2] = (-b - root) / a, (-b + root) / a
    entry, leave = near.max(axis=0), far.min(axis=0)
    shade = np.array(SHADES)[np.nan_to_num(near, nan=-np.inf).argmax(axis=0)]
    return np.where(entry < leave, entry, np.inf), shade


def labeled(name, solid, number, **more):
    return ObjectQuery(name, solid.position_m, solid.quaternion_xyzw, (number,), **more)
