"""Arms whose geometry is known by a name, each with a usual hand."""

from collections.abc import Mapping
from typing import Literal

from roboprompt_client.arms.geometry import Chain
from roboprompt_client.arms.panda import LIMITS_RAD, PandaGeometry
from roboprompt_client.arms.ur_geometry import URGeometry

ArmModel = Literal["panda", "fr3", "ur3e", "ur5e", "ur10e", "ur16e"]
TITLES: Mapping[str, str] = {
    "panda": "Franka Panda",
    "fr3": "Franka Research 3",
    "ur3e": "UR3e",
    "ur5e": "UR5e",
    "ur10e": "UR10e",
    "ur16e": "UR16e",
}


def named_geometry(model: ArmModel) -> Chain:
    """Return the geometry of a Franka with a Franka Hand, or of a Universal Robots arm with a Robotiq 2F-85."""
    return PandaGeometry(model) if model in LIMITS_RAD else URGeometry(model)
