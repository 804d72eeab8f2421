"""The robot's side of RoboPrompt: a client of the service, the Robot Protocol, and the loop that ties them.

    with RoboPromptClient("http://127.0.0.1:8000") as client:
        run_task(client, my_robot, "open_drawer", "open the bottom drawer")

Needs numpy and httpx. Meters, radians, seconds; poses in the world frame; quaternions x y z w.

- What the service is asked and what it answers: `client`, `answers`.
- What a run does between `observe` and `execute`: `runs.loop`. Where a limit of motion is checked: `motion.guard`.
- Arms: `arms.driver` has the Protocol of a new one, `arms.arm` makes a `Robot` of it, `cell` names it.
"""

from roboprompt_client.answers import Outcome, PlannedStep, PredictedActions
from roboprompt_client.arms.driver import ArmState
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import (
    DangerError,
    InvalidAnswerError,
    InvalidInputError,
    MotionError,
    NotConfirmedError,
    ObjectLostError,
    RoboPromptError,
    ServiceProblemError,
    ServiceUnreachableError,
    StepFailedError,
    UnsafeActionError,
)
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.recording import Recorder
from roboprompt_client.robot import Observation, Robot
from roboprompt_client.runs.loop import run_plan, run_task
from roboprompt_client.types.camera import Camera, RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

__all__ = [
    "ArmState",
    "Box",
    "Camera",
    "DangerError",
    "EndEffectorAction",
    "InvalidAnswerError",
    "InvalidInputError",
    "MotionError",
    "MotionLimits",
    "NotConfirmedError",
    "ObjectLostError",
    "ObjectPose",
    "Observation",
    "Outcome",
    "PlannedStep",
    "Pose",
    "PredictedActions",
    "Recorder",
    "RgbdFrame",
    "RoboPromptClient",
    "RoboPromptError",
    "Robot",
    "ServiceProblemError",
    "ServiceUnreachableError",
    "StepFailedError",
    "Trajectory",
    "UnsafeActionError",
    "run_plan",
    "run_task",
]
