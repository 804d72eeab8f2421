"""What robots send."""

import json
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from app.api.schemas import examples
from app.perception.base import ObjectQuery
from app.perception.strict import WHOLE, Meters, Number, Truth
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
LEFT_OUT = "whether it is kept, but shown in no prompt"


class RequestModel(BaseModel):
    """Strict about names: a misspelled field is an error, not silence."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def _short_json(value: dict[str, Any]) -> dict[str, Any]:
    size = len(json.dumps(value, allow_nan=False, ensure_ascii=False).encode())
    if size > MAX_EXTRA_BYTES:
        raise InvalidInputError("extra", f"has {size} bytes as JSON", f"at most {MAX_EXTRA_BYTES} bytes")
    return value


class ObjectIn(RequestModel):
    """An object of the scene: its pose in the world frame where the robot knows it, or its ids in the mask images."""

    name: Name
    position: Annotated[Position | None, Field(description="meters, world frame")] = None
    quaternion_xyzw: Annotated[Quaternion | None, Field(description="unit quaternion, world frame")] = None
    mask_ids: Annotated[list[MaskId], Field(max_length=64, description="ids of its pixels in mask_NAME")] = []

    def query(self) -> ObjectQuery:
        """As perception wants it."""
        return ObjectQuery(self.name, self.position, self.quaternion_xyzw, tuple(self.mask_ids))


class Intrinsics(RequestModel):
    """Pinhole intrinsics in pixels; pixel centers are whole numbers."""

    fx: Pixels
    fy: Pixels
    cx: Pixels
    cy: Pixels
    width: Annotated[int | None, Field(gt=0, description="of the images; checked where given"), WHOLE] = None
    height: Annotated[int | None, Field(gt=0), WHOLE] = None


class CameraIn(RequestModel):
    """A calibrated camera; its images are the parts rgb_NAME, depth_NAME and mask_NAME."""

    name: Name
    intrinsics: Intrinsics
    camera_to_world: Annotated[
        tuple[Row4, Row4, Row4, Row4],
        Field(
            description="4x4 rigid transform from OpenCV camera axes (x right, y down, z forward) to the world, meters"
        ),
    ]
    depth_scale: Annotated[
        Number,
        Field(ge=MIN_DEPTH_SCALE_M, le=MAX_DEPTH_SCALE_M, description="meters per unit of a 16-bit depth image"),
    ] = 0.001

    def camera(self) -> Camera:
        """As the pipeline wants it."""
        k = self.intrinsics
        size = (k.width, k.height) if k.width is not None and k.height is not None else None
        return Camera(self.name, k.fx, k.fy, k.cx, k.cy, np.array(self.camera_to_world), self.depth_scale, size)


class EpisodeMetadata(RequestModel):
    """The part `metadata` of an upload."""

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, json_schema_extra={"examples": [examples.SAMPLE_METADATA]}
    )

    task: Name
    instruction: Instruction
    objects: Annotated[list[ObjectIn], Field(min_length=1, max_length=64)]
    cameras: Annotated[list[CameraIn], Field(max_length=16)] = []
    control_frequency_hz: Annotated[
        Number,
        Field(
            ge=MIN_FREQUENCY_HZ,
            le=MAX_FREQUENCY_HZ,
            description="of a trajectory without timestamps; with them the measured rate is stored",
        ),
    ] = 20.0
    prediction_id: Annotated[
        str | None, Field(max_length=64, description="of the prediction of this task that the robot carried out here")
    ] = None
    extra: Annotated[
        dict[str, Any],
        AfterValidator(_short_json),
        Field(
            description="kept with the episode, at most 64 kB; `commanded_positions` (T, 3), where the hand was sent,"
            " may show contact, and the rest is not interpreted"
        ),
    ] = {}
    left_out: Annotated[Truth, Field(description=LEFT_OUT)] = False
    note: Annotated[Note, Field(description="for people")] = ""
    uploaded_instruction: Annotated[
        Instruction | None, Field(description="of an episode whose instruction was corrected elsewhere: the first one")
    ] = None


class EpisodeEdit(RequestModel):
    """What to correct of an episode; what is not named, or null, stays."""

    instruction: Instruction | None = None
    left_out: Annotated[Truth | None, Field(description=LEFT_OUT)] = None
    note: Annotated[Note | None, Field(description="for people; empty for none")] = None


class TrajectoryIn(RequestModel):
    """The trajectory of a JSON upload; in multipart it is the .npz part `trajectory` with the same arrays."""

    end_effector_positions: Annotated[list[list[Number]], Field(description="(T, 3) m, world frame")]
    end_effector_quaternions_xyzw: Annotated[list[list[Number]], Field(description="(T, 4), world frame")]
    gripper_open: Annotated[
        list[float] | None,
        Field(
            description="(T,) 1 open, 0 closed: what the fingers have done (closed once they hold something or have"
            " come to rest), e.g. their width above or below the middle between its extremes. Commands come earlier;"
            " both are the same where the arm rests while it grasps. Suction: 0 while it holds. No gripper: 1"
        ),
    ] = None
    gripper_width: Annotated[
        list[Number] | None,
        Field(description="(T,) m between the fingers, measured; instead of gripper_open or beside it"),
    ] = None
    joint_velocities: Annotated[
        list[list[Number]] | None,
        Field(description="(T, J) rad/s; left out they follow from joint_positions and timestamps"),
    ] = None
    timestamps: Annotated[list[Number] | None, Field(description="(T,) s")] = None
    joint_positions: Annotated[list[list[Number]] | None, Field(description="(T, J) rad")] = None
    object_positions: Annotated[
        list[list[list[Number]]] | None,
        Field(description="(T, N, 3) m, of the objects in their order: for closed-loop predictions"),
    ] = None
    object_quaternions_xyzw: Annotated[list[list[list[Number]]] | None, Field(description="(T, N, 4)")] = None
    wrenches: Annotated[
        list[list[Number]] | None,
        Field(description="(T, 6) N and Nm that act on the hand, along the world's axes: kept, not interpreted"),
    ] = None


class EpisodeJson(BaseModel):
    """An upload as one JSON document; images are further fields rgb_NAME, depth_NAME, mask_NAME in base64."""

    model_config = ConfigDict(extra="allow", json_schema_extra={"examples": [examples.EPISODE]})

    metadata: EpisodeMetadata
    trajectory: TrajectoryIn


class EndEffectorIn(RequestModel):
    """Where the robot's end effector is now."""

    position: Annotated[Position, Field(description="meters, world frame")]
    quaternion_xyzw: Annotated[Quaternion, Field(description="unit quaternion, world frame")]

    def pose(self) -> Pose:
        """As the pipeline wants it; raises InvalidInputError for a quaternion that is none of unit length."""
        unit = unit_quaternions("end_effector.quaternion_xyzw", self.quaternion_xyzw, (4,))
        return Pose(self.position, tuple(unit.tolist()))


class RunBody(RequestModel):
    """Where a robot is with what it carries out."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    task: Name
    instruction: Instruction
    prediction_id: Annotated[str | None, Field(max_length=64, description="left out while it is not known")] = None
    action: Annotated[int | None, Field(ge=1, le=1000, description="the one that is carried out, from 1"), WHOLE] = None
    target: Annotated[EndEffectorIn | None, Field(description="of that action")] = None
    end_effector: Annotated[EndEffectorIn | None, Field(description="where it is, measured")] = None
    joint_positions: Annotated[list[Number] | None, Field(max_length=16, description="rad")] = None
    gripper_open: Truth | None = None


class PredictBody(PredictOptions, RequestModel):
    """An observation, an instruction, and how to predict. What is left out follows the task, then the model."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, json_schema_extra={"examples": [examples.PREDICT]})

    task: Annotated[
        Name | None,
        Field(
            description="left out: the one task of exactly these objects that does what the instruction says; the "
            "answer names it. Refused where none does, or several do"
        ),
    ] = None
    instruction: Instruction
    objects: Annotated[list[ObjectIn], Field(min_length=1, max_length=64)]
    cameras: Annotated[list[CameraIn], Field(max_length=16)] = []
    end_effector: Annotated[
        EndEffectorIn | None,
        Field(
            description="the first action's way begins here; required where the task's motion_limits bound steps "
            "(max_step_m, max_step_rotation_deg), but for later steps of a closed loop"
        ),
    ] = None
    dry_run: Annotated[Truth, Field(description="answer with the prompt, ask no LLM")] = False


class PlanBody(RequestModel):
    """What a person asks for, of tasks that were taught apart, and what is there."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, json_schema_extra={"examples": [examples.PLAN]})

    instruction: Instruction
    objects: Annotated[
        list[ObjectIn],
        Field(min_length=1, max_length=64, description="all of the scene; words of place need positions"),
    ]


class OutcomeBody(RequestModel):
    """How the robot fared with a prediction."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [examples.OUTCOME]})

    success: Truth
    note: Annotated[Annotated[str, AfterValidator(plain_text)] | None, Field(max_length=2000)] = None
