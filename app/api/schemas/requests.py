"""Bodies of requests: episodes, predictions, plans and outcomes."""

import json
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from app.api.schemas import examples
from app.perception.base import ObjectQuery
from app.perception.object_model import WHOLE, Meters, Number, Truth
from app.pipeline.episode import MAX_FREQUENCY_HZ, MIN_FREQUENCY_HZ
from app.services.predict.request import PredictOptions
from app.services.task_settings import plain_text
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import unit_quaternions
from roboprompt_client.types.camera import MAX_DEPTH_SCALE_M, MAX_PX, MIN_DEPTH_SCALE_M, Camera
from roboprompt_client.types.poses import Pose

MAX_EXTRA_BYTES = 65_536
Position = tuple[Meters, Meters, Meters]
Quaternion = tuple[Number, Number, Number, Number]
Row4 = tuple[Meters, Meters, Meters, Meters]
Pixels = Annotated[Number, Field(ge=-MAX_PX, le=MAX_PX)]
Name = Annotated[str, Field(min_length=1, max_length=64)]
MaskId = Annotated[int, WHOLE]
Instruction = Annotated[str, Field(min_length=1, max_length=500)]
Note = Annotated[str, Field(max_length=500), AfterValidator(plain_text)]
LEFT_OUT = "true: the episode is kept, but no prompt shows it"


class Described(BaseModel):
    """A model whose fields are described in the OpenAPI document by the texts below them."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class RequestModel(Described):
    """Refuses unknown fields, so that a misspelled one is an error."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def _short_json(value: dict[str, Any]) -> dict[str, Any]:
    size = len(json.dumps(value, allow_nan=False, ensure_ascii=False).encode())
    if size > MAX_EXTRA_BYTES:
        raise InvalidInputError("extra", f"has {size} bytes as JSON", f"at most {MAX_EXTRA_BYTES} bytes")
    return value


class ObjectIn(RequestModel):
    """An object of the scene: its pose in the world frame where the robot knows it, or its ids in the mask images."""

    name: Name
    position: Position | None = None
    """meters, world frame"""
    quaternion_xyzw: Quaternion | None = None
    """unit quaternion, world frame"""
    mask_ids: Annotated[list[MaskId], Field(max_length=64)] = []
    """ids of the object's pixels in mask_NAME"""

    def query(self) -> ObjectQuery:
        """Return the object as a query for a pose estimator."""
        return ObjectQuery(self.name, self.position, self.quaternion_xyzw, tuple(self.mask_ids))


class Intrinsics(RequestModel):
    """Pinhole intrinsics in pixels; pixel centers are whole numbers."""

    fx: Pixels
    fy: Pixels
    cx: Pixels
    cy: Pixels
    width: Annotated[int | None, Field(gt=0), WHOLE] = None
    """of the images, pixels; if given, images of another size are refused"""
    height: Annotated[int | None, Field(gt=0), WHOLE] = None


class CameraIn(RequestModel):
    """A calibrated camera; its images are the parts rgb_NAME, depth_NAME and mask_NAME."""

    name: Name
    intrinsics: Intrinsics
    camera_to_world: tuple[Row4, Row4, Row4, Row4]
    """4x4 rigid transform from OpenCV camera axes (x right, y down, z forward) to the world, meters"""
    depth_scale: Annotated[Number, Field(ge=MIN_DEPTH_SCALE_M, le=MAX_DEPTH_SCALE_M)] = 0.001
    """meters per unit of a 16-bit depth image"""

    def camera(self) -> Camera:
        """Return the camera as the pipeline's type."""
        k = self.intrinsics
        size = (k.width, k.height) if k.width is not None and k.height is not None else None
        return Camera(self.name, k.fx, k.fy, k.cx, k.cy, np.array(self.camera_to_world), self.depth_scale, size)


class EpisodeMetadata(RequestModel):
    """The part `metadata` of an upload."""

    model_config = examples.shown(examples.METADATA)

    task: Name
    instruction: Instruction
    objects: Annotated[list[ObjectIn], Field(min_length=1, max_length=64)]
    cameras: Annotated[list[CameraIn], Field(max_length=16)] = []
    control_frequency_hz: Annotated[Number, Field(ge=MIN_FREQUENCY_HZ, le=MAX_FREQUENCY_HZ)] = 20.0
    """rate of a trajectory without timestamps; with timestamps the measured rate is stored"""
    prediction_id: Annotated[str | None, Field(max_length=64)] = None
    """id of the prediction of this task that the robot carried out in this episode"""
    corrects: Annotated[str | None, Field(max_length=64)] = None
    """id of the prediction of this task that failed: the episode shows how its scene is done"""
    extra: Annotated[dict[str, Any], AfterValidator(_short_json)] = {}
    """any JSON to keep with the episode, at most 64 kB. Only `commanded_positions` (T, 3), the commanded hand
    positions, is interpreted: it may show contact"""
    left_out: Annotated[Truth, Field(description=LEFT_OUT)] = False
    note: Note = ""
    """a remark for people"""
    uploaded_instruction: Instruction | None = None
    """the first instruction, if it was corrected before this upload"""


class EpisodeEdit(RequestModel):
    """Corrections of an episode; a field that is left out or null stays as it is."""

    model_config = examples.shown(examples.EDIT)

    instruction: Instruction | None = None
    left_out: Annotated[Truth | None, Field(description=LEFT_OUT)] = None
    note: Note | None = None
    """a remark for people; empty removes it"""

    def changes(self) -> dict[str, Any]:
        """Return the fields that change."""
        return self.model_dump(exclude_none=True)


class TrajectoryIn(RequestModel):
    """The trajectory of a JSON upload; in multipart it is the .npz part `trajectory` with the same arrays."""

    end_effector_positions: list[list[Number]]
    """(T, 3) m, world frame"""
    end_effector_quaternions_xyzw: list[list[Number]]
    """(T, 4), world frame"""
    gripper_open: list[float] | None = None
    """(T,) 1 open, 0 closed: what the fingers have done (closed once they hold something or have come to rest),
    e.g. their width above or below the middle between its extremes. Commands come earlier; both are the same where
    the arm rests while it grasps. Suction: 0 while it holds. No gripper: 1"""
    gripper_width: list[Number] | None = None
    """(T,) measured distance between the fingers, m; instead of gripper_open or with it"""
    joint_velocities: list[list[Number]] | None = None
    """(T, J) rad/s; if left out, computed from joint_positions and timestamps"""
    timestamps: list[Number] | None = None
    """(T,) s"""
    joint_positions: list[list[Number]] | None = None
    """(T, J) rad"""
    object_positions: list[list[list[Number]]] | None = None
    """(T, N, 3) m, of the objects in the order of metadata; they show what the hand pushes or carries"""
    object_quaternions_xyzw: list[list[list[Number]]] | None = None
    """(T, N, 4)"""
    wrenches: list[list[Number]] | None = None
    """(T, 6) force in N and torque in Nm on the hand, along the world's axes; only kept"""


class EpisodeJson(Described):
    """An upload as one JSON document; images are further fields rgb_NAME, depth_NAME, mask_NAME in base64."""

    model_config = ConfigDict(extra="allow") | examples.shown(examples.EPISODE)

    metadata: EpisodeMetadata
    trajectory: TrajectoryIn


class EndEffectorIn(RequestModel):
    """The present pose of the robot's end effector."""

    position: Position
    """meters, world frame"""
    quaternion_xyzw: Quaternion
    """unit quaternion, world frame"""

    def pose(self) -> Pose:
        """Return the pose; raise InvalidInputError unless the quaternion has unit length."""
        unit = unit_quaternions("end_effector.quaternion_xyzw", self.quaternion_xyzw, (4,))
        return Pose(self.position, unit)


class PredictBody(PredictOptions, RequestModel):
    """An observation, an instruction and options. Options that are left out come from the task, then from the model."""

    model_config = examples.shown(examples.PREDICT)

    task: Name | None = None
    """if left out, the service looks for the one task that has exactly these objects and does what the instruction
    says, and the answer names it; no such task, or several, is an error"""
    instruction: Instruction
    objects: Annotated[list[ObjectIn], Field(min_length=1, max_length=64)]
    cameras: Annotated[list[CameraIn], Field(max_length=16)] = []
    end_effector: EndEffectorIn | None = None
    """the present pose, where the motion to the first action begins. Required if the task's motion_limits have
    max_step_m or max_step_rotation_deg"""
    dry_run: Truth = False
    """true: answer with the prompt and ask no LLM"""


class PlanBody(RequestModel):
    """A sentence over several tasks, and the objects of the scene."""

    model_config = examples.shown(examples.PLAN)

    instruction: Instruction
    objects: Annotated[list[ObjectIn], Field(min_length=1, max_length=64)]
    """all objects of the scene; words such as 'left' need positions"""


class OutcomeBody(RequestModel):
    """Whether the robot succeeded with a prediction."""

    model_config = examples.shown(examples.OUTCOME)

    success: Truth
    note: Annotated[Annotated[str, AfterValidator(plain_text)] | None, Field(max_length=2000)] = None
