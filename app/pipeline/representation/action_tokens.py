"""Action tokens: each action is three points of the end effector in millimeters (KAT, arXiv 2403.19578).

KAT ("Keypoint Action Tokens Enable In-Context Imitation Learning in Robotics", Di Palo and Johns, RSS 2024) is a method
that the paper compares with; tokens in place of bins are one of the paper's ablations (supplement, "Direct action
prediction").
"""

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.pipeline.episode import Demonstration
from app.pipeline.errors import ReplyParseError
from app.pipeline.representation.absolute import AbsoluteCodec, Column, row_integers
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction

MM_PER_M = 1000
LEVER_MM = 100
# the end effector's position, and the points on its x and y axis, in its own frame
TRIPLET_MM = LEVER_MM * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
# Whole millimeters are up to half a millimeter off along each axis, and the best fit is no worse than the true pose.
ROUNDING_RESIDUAL_MM = math.sqrt(3) / 2
# An LLM goes between its demonstrations point by point, which bends a triplet (half-way between rotations 45 degrees
# apart by up to 5 mm). Ten times the rounding leaves room for that, and stands for 5 degrees at the lever: one of the
# paper's rotation bins.
MAX_RESIDUAL_MM = 10 * ROUNDING_RESIDUAL_MM
MAX_MM = 99_999  # no arm reaches that far; keeps an LLM's endless digits out


class ActionTokensCodec(AbsoluteCodec):
    """The paper's ablation: its prompt, the objects in bins, but each action as a triplet of points.

    ``{'drawer': [42, 65, 29], 'open the drawer'}>[[165, 245, 1155, 165, 345, 1155, 165, 245, 1255, 1], ...], ``.
    """

    columns: ClassVar[Sequence[Column]] = (
        *(Column(f"{axis} of point {point}", -MAX_MM, MAX_MM) for point in (1, 2, 3) for axis in "xyz"),
        Column("gripper", 0, 1),
    )
    row_rules: ClassVar[str] = """row ::= "[" point ", " point ", " point ", " [01] "]"
point ::= mm ", " mm ", " mm
mm ::= "0" | "-"? [1-9] [0-9]{0,4}
"""

    def actions_text(self, demonstration: Demonstration) -> str:
        return str([_tokens(action) for action in demonstration.actions])

    def _actions(self, first: int, rows: Sequence[str]) -> list[EndEffectorAction]:
        return [_action(index, row, self.columns) for index, row in enumerate(rows, start=first)]


def _action(index: int, row: str, columns: Sequence[Column]) -> EndEffectorAction:
    *coordinates, gripper = row_integers(row, index, columns)
    points_mm = np.array(coordinates).reshape(3, 3)
    if not np.cross(points_mm[1] - points_mm[0], points_mm[2] - points_mm[0]).any():
        raise ReplyParseError(f"action {index}: its three points lie on one line, which leaves a turn open", row)
    position_mm, rotation, residual_mm = _rigid_fit(points_mm)
    if residual_mm > MAX_RESIDUAL_MM:
        fault = f"its three points are {residual_mm:.1f} mm (rms) off those of an end effector"
        raise ReplyParseError(f"action {index}: {fault}, at most {MAX_RESIDUAL_MM:.1f} mm", row)
    return EndEffectorAction(position_mm / MM_PER_M, rotation.as_quat(canonical=True), bool(gripper))


def _tokens(action: EndEffectorAction) -> list[int]:
    """The nine coordinates of an action's three points in whole millimeters, and the gripper (1 = open)."""
    offsets_m = Rotation.from_quat(action.quaternion_xyzw).apply(TRIPLET_MM / MM_PER_M)
    points_mm = MM_PER_M * (action.position_m + offsets_m).ravel()
    return [*map(round, points_mm.tolist()), int(action.gripper_open)]


def _rigid_fit(points_mm: npt.NDArray[np.int_]) -> tuple[Array, Rotation, float]:
    """The pose whose triplet comes nearest to three points (Kabsch).

    Returns:
        position (3,) in mm, rotation, and the root mean square of the three distances in mm.
    """
    center_mm, triplet_center_mm = points_mm.mean(axis=0), TRIPLET_MM.mean(axis=0)
    rotation, root_sum_mm = Rotation.align_vectors(points_mm - center_mm, TRIPLET_MM - triplet_center_mm)
    position_mm: Array = center_mm - rotation.apply(triplet_center_mm)
    return position_mm, rotation, float(root_sum_mm) / math.sqrt(len(points_mm))
