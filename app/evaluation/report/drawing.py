"""Object poses and actions drawn into a camera's image."""

from collections.abc import Sequence

import numpy as np

from app.drawing import Canvas, Color, RgbImage
from roboprompt_client.arrays import Array
from roboprompt_client.camera import Camera
from roboprompt_client.trajectory import EndEffectorAction, ObjectPose

OBJECT_COLOR: Color = (228, 130, 83)  # the paper's colors of object poses and actions
ACTION_COLOR: Color = (0, 113, 188)
WHITE: Color = (255, 255, 255)
SAME_PLACE_PX = 8.0


def draw_scene(
    image: RgbImage, camera: Camera, poses: Sequence[ObjectPose], actions: Sequence[EndEffectorAction] = ()
) -> RgbImage:
    """A copy of `image` (H, W, 3) with objects as axes and names, and actions as a numbered path.

    An action's dot is hollow where the gripper is open. What is outside of the image is left out.
    """
    canvas = Canvas(camera, image.copy())
    way_m = np.array([action.position_m for action in actions]).reshape(-1, 3)
    canvas.line(way_m, ACTION_COLOR)
    for action in actions:
        canvas.dot(action.position_m, WHITE if action.gripper_open else ACTION_COLOR, ACTION_COLOR)
    for pose in poses:
        canvas.pose(pose, OBJECT_COLOR)
    for numbers, point_m in _numbered(camera, way_m):
        canvas.name(numbers, point_m, ACTION_COLOR)
    for pose in poses:
        canvas.name(pose.name, pose.position_m, OBJECT_COLOR)
    return canvas.image


def _numbered(camera: Camera, way_m: Array) -> list[tuple[str, Array]]:
    """The numbers of the actions at each place of the image, e.g. ``("1, 3", point)``."""
    places: list[tuple[list[int], Array, Array]] = []
    for number, (point_m, pixel) in enumerate(zip(way_m, camera.project(way_m)[0], strict=True), start=1):
        for numbers, _, place in places:
            if np.linalg.norm(pixel - place) < SAME_PLACE_PX:
                numbers.append(number)
                break
        else:
            places.append(([number], point_m, pixel))
    return [(", ".join(map(str, numbers)), point_m) for numbers, point_m, _ in places]
