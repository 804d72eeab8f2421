"""The laptop of the laptop tasks: it stands on the table, hinge towards the robot, its front edge away from it."""

import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.sim.scene import NO_TURN, Part
from app.sim.tasks.base import SimTask

HALF_DEPTH_M, HALF_WIDTH_M, HALF_THICKNESS_M = 0.11, 0.15, 0.011
FEET_M = 0.003
CENTRE_HEIGHT_M = FEET_M + HALF_THICKNESS_M  # above the table
HINGE_M = (-HALF_DEPTH_M, 0.0, HALF_THICKNESS_M)  # in the laptop's frame
LID_LENGTH_M, LID_THICKNESS_M = 0.20, 0.008
LID_KG = 0.3
MARK_M = 0.0005


def add_laptop(task: SimTask, centre_m: npt.ArrayLike, turn: Rotation) -> Part:
    """The body `laptop` with keyboard and touchpad; its origin is the base's centre, x points to the front edge."""
    laptop = task.add_part("laptop", centre_m, turn)
    laptop.box((HALF_DEPTH_M, HALF_WIDTH_M, HALF_THICKNESS_M), "grey")
    for x_m in (-0.08, 0.08):
        laptop.box((0.01, 0.13, FEET_M / 2), "black", at_m=[x_m, 0, -HALF_THICKNESS_M - FEET_M / 2])
    for x_m, half_m in ((-0.03, (0.05, 0.13)), (0.07, (0.03, 0.04))):
        laptop.mark((*half_m, MARK_M), "black", at_m=[x_m, 0, HALF_THICKNESS_M])
    return laptop


def add_lid(task: SimTask, laptop: Part, opened: Rotation = NO_TURN) -> Part:
    """The body `lid` about the hinge, along x where it is closed; the screen is on its lower side."""
    lid = task.add_part("lid", HINGE_M, opened, parent=laptop)
    half_sizes_m = (LID_LENGTH_M / 2, HALF_WIDTH_M, LID_THICKNESS_M / 2)
    lid.box(half_sizes_m, "black", at_m=[LID_LENGTH_M / 2, 0, LID_THICKNESS_M / 2], mass_kg=LID_KG)
    return lid.mark((LID_LENGTH_M / 2 - 0.012, HALF_WIDTH_M - 0.012, MARK_M), "cyan", at_m=[LID_LENGTH_M / 2, 0, 0])
