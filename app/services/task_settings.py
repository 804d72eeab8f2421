"""The settings of a task. Each has a default; a first upload creates the task with the defaults."""

import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)
from scipy.spatial.transform import Rotation
from sqlalchemy import Connection

from app.perception.base import ESTIMATOR_NAMES
from app.perception.models import AsObjectModel, model_from_json
from app.perception.object_model import WHOLE, Number, ObjectModelError
from app.pipeline.geometry import canonical_pose
from app.pipeline.keyframes import Motion
from app.pipeline.names import check_aliases_of, checked_aliases, spelling_variants
from app.pipeline.order.space import Layout
from app.pipeline.prompt import MAX_SYSTEM_PROMPT_CHARS
from app.pipeline.representation.base import check_style
from app.pipeline.workspace import Workspace
from app.services.setting_parts import (
    KeyframeSettings,
    MotionLimitsSettings,
    Point,
    WorkspaceSettings,
)
from app.store import episodes, tasks
from app.store.records import ExtractionKeys, TaskRecord
from app.store.values import JsonObject
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.geometry import Chain
from roboprompt_client.arms.named import ArmModel, named_geometry
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion.limits import Box, MotionLimits
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.names import checked_object_name
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import MAX_GRIPPER_WIDTH_M, MAX_JOINTS, Trajectory

Representation = Literal["absolute", "object_frame", "action_tokens", "parts"]
PromptFormat = Literal["paper", "authors", "sums"]
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
OF_KEYFRAMES, OF_POSES = ("keyframes", "gripper_open_above_m"), ("pose_estimator", "object_models")
MERGED = ("workspace", "keyframes", "motion_limits")  # a change keeps what it does not name of them
MAX_SPANNED = 100  # demonstrations, as many as a prompt shows at most
MIN_SYMMETRY_DEG = 1.0  # what is rounder is round


def plain_text(value: str) -> str:
    """`value`, if it has no control characters but tabs and line ends: databases and logs do not take all of them."""
    if found := _CONTROL.search(value):
        raise ValueError(f"has the control character {found[0]!r} at {found.start()}")
    return value


SystemPrompt = Annotated[str, Field(max_length=MAX_SYSTEM_PROMPT_CHARS), AfterValidator(plain_text)]


def _digest(settings: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:16]


def _known_estimator(name: str) -> str:
    if name not in ESTIMATOR_NAMES:
        raise InvalidInputError("pose_estimator", f"is {name!r}", ", ".join(ESTIMATOR_NAMES))
    return name


def _known_models(models: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The models with every field, those left out at their defaults."""
    json.dumps(models, allow_nan=False)
    return {
        checked_object_name("object_models", name): model_from_json(name, item).as_json()
        for name, item in models.items()
    }


def _symmetry(degrees: float) -> float:
    if degrees != 0 and not (MIN_SYMMETRY_DEG <= degrees <= 360 and abs(360 / degrees - round(360 / degrees)) < 1e-9):
        raise ValueError("must be 0 (round) or divide 360, e.g. 90 for a cube")
    return degrees


class TaskSettings(BaseModel):
    """A task's settings.

    `representation`, `prompt_format` and `system_prompt` left out (null) follow the model: what suits it best.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    workspace: WorkspaceSettings = WorkspaceSettings(preset="auto")
    keyframes: KeyframeSettings = KeyframeSettings()
    pose_estimator: Annotated[str, AfterValidator(_known_estimator)] = "given"
    object_models: Annotated[
        dict[str, Annotated[dict[str, Any], AsObjectModel()]],
        AfterValidator(_known_models),
        Field(
            description="per object what is known of it beforehand; its `estimator` (cuboid, markers, masks, "
            "registered, remote) finds the object, `pose_estimator` those without a model"
        ),
    ] = {}
    motion_limits: MotionLimitsSettings = MotionLimitsSettings()
    representation: Representation | None = None
    prompt_format: PromptFormat | None = None
    system_prompt: SystemPrompt | None = None
    num_demonstrations: Annotated[int, Field(ge=1, le=100), WHOLE] = 10
    num_joints: Annotated[
        int | None, Field(ge=1, le=MAX_JOINTS, description="of the arm; null: the first episode decides"), WHOLE
    ] = None
    gripper_open_above_m: Annotated[
        Number | None,
        Field(
            ge=0,
            le=MAX_GRIPPER_WIDTH_M,
            description="the measured `gripper_width` above which the gripper counts as open;"
            " null: from the middle of the way on, each time the fingers move",
        ),
    ] = None
    aliases: Annotated[
        dict[str, Annotated[tuple[str, ...], Field(max_length=32)]],
        Field(description="per object what people call it besides its name; no two objects share one"),
    ] = {}
    ways: Annotated[
        Literal["one", "several"],
        Field(
            description="in how many ways demonstrations of one instruction do it; several: ways that neither words nor"
            " scene decide are all right"
        ),
    ] = "one"
    robot_base: Annotated[
        Point,
        Field(description="where the robot's base stands, meters, world frame; it looks along `robot_base_yaw_deg`"),
    ] = (0.0, 0.0, 0.0)
    robot_base_yaw_deg: Annotated[
        Number,
        Field(
            ge=-180,
            le=180,
            description="where the robot looks, degrees from the world's +x toward +y: `left` and `behind` are as it"
            " sees them; at 0 left is +y",
        ),
    ] = 0.0
    arm: Annotated[
        ArmModel | None,
        Field(
            description="the robot (a Franka with a Franka Hand, a UR with a Robotiq 2F-85): pages draw it, and paths"
            " are checked for what its joints reach; null: not known"
        ),
    ] = None
    gripper_symmetry_deg: Annotated[
        Literal[180] | None,
        Field(
            description="180: a hand turned by half a turn about its z axis, along which it approaches, grasps alike,"
            " and the turn that is nearer to demonstrated wrist angles is taken; null: actions are as the model says"
        ),
    ] = None
    yaw_symmetry_deg: Annotated[
        dict[str, Annotated[Number, AfterValidator(_symmetry)]],
        Field(
            description="per object the turn about its z axis that leaves it unchanged: cube 90, cuboid 180, round 0"
        ),
    ] = {}

    @field_validator("prompt_format")
    @classmethod
    def _of_the_representation(cls, value: PromptFormat | None, info: ValidationInfo) -> PromptFormat | None:
        representation = info.data.get("representation")
        if value is not None and representation is not None:
            check_style(representation, value)
        return value

    @field_validator("aliases")
    @classmethod
    def _names_one_object_each(cls, value: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        return checked_aliases(value)

    @model_validator(mode="after")
    def _one_spelling_of_each_object(self) -> Self:
        for one, other in spelling_variants((*self.aliases, *self.object_models, *self.yaw_symmetry_deg)):
            raise ValueError(f"{one!r} and {other!r} are one name: the objects of a task must differ in more")
        return self

    @classmethod
    def of(cls, connection: Connection, name: str) -> Self:
        """Return a task's settings; raises NotFoundError."""
        return cls.read(connection, tasks.get(connection, name))

    @classmethod
    def read(cls, connection: Connection, task: TaskRecord) -> Self:
        """Return a task's settings; a workspace `auto` is the box of its demonstrations."""
        settings = cls.model_validate(task.settings)
        if settings.workspace.preset != "auto":
            return settings
        shown = episodes.demonstrations(connection, task.name, MAX_SPANNED)
        spanned = Workspace.of_demonstrations([record.places_m() for record in shown])
        box = WorkspaceSettings(preset="auto", min=tuple(spanned.min_m.tolist()), max=tuple(spanned.max_m.tolist()))
        return settings.model_copy(update={"workspace": box})

    def stored(self) -> JsonObject:
        """Return what `read` reads: without the box of a workspace `auto`, which follows from the demonstrations."""
        box = {"workspace": {"preset": "auto"}} if self.workspace.preset == "auto" else {}
        return {**self.model_dump(mode="json"), **box}

    def geometry(self) -> Chain | None:
        """Return the kinematics of the arm, if it is known."""
        return None if self.arm is None else named_geometry(self.arm)

    def base(self) -> Calibration:
        """Return the pose of the robot's base."""
        turn = Rotation.from_euler("z", self.robot_base_yaw_deg, degrees=True)
        return Calibration(np.array(self.robot_base), turn.as_quat())

    def layout(self, positions_m: Mapping[str, Array]) -> Layout:
        """Return where objects (3,) are as the robot sees them."""
        return Layout(positions_m, np.array(self.robot_base), math.radians(self.robot_base_yaw_deg))

    def limits_of_motion(self) -> MotionLimits:
        bounds, box = self.motion_limits, self.workspace
        keep_out = tuple(Box(item.min, item.max) for item in bounds.keep_out)
        step_m, step_deg = bounds.max_step_m, bounds.max_step_rotation_deg
        return MotionLimits(Box(box.min, box.max), keep_out, step_m, step_deg, bounds.hand_radius_m)

    def changed(self, changes: Mapping[str, Any]) -> "TaskSettings":
        """With these settings; of workspace, keyframes and motion limits only what the change names.

        Raises:
            pydantic.ValidationError: if the settings do not go together.
        """
        old = self.model_dump()
        new = {name: {**old[name], **value} if name in MERGED else value for name, value in changes.items()}
        if "workspace" in changes:  # a preset has its own box, and a box of one's own is no preset
            box = changes["workspace"]
            new["workspace"] = {"preset": box["preset"]} if box.get("preset") else {**new["workspace"], "preset": None}
        return TaskSettings.model_validate({**old, **new})

    @property
    def extraction_keys(self) -> ExtractionKeys:
        """Return digests of what keyframes and object poses depend on beside the recording."""
        chosen = self.model_dump(mode="json")
        return ExtractionKeys(*(_digest({name: chosen[name] for name in names}) for names in (OF_KEYFRAMES, OF_POSES)))

    def with_recording(self, trajectory: Trajectory, control_frequency_hz: float) -> tuple["TaskSettings", Motion]:
        """Return the settings, with the number of joints once an episode shows it, and its motion (`motion_of`).

        Raises:
            InvalidInputError: if the trajectory is another arm's.
        """
        found = trajectory.num_joints
        if found and self.num_joints not in (None, found):
            message = f"has {found} joints, but the task's arm has {self.num_joints}"
            raise InvalidInputError("trajectory.joint_velocities", message, f"shape (T, {self.num_joints})")
        settings = self.model_copy(update={"num_joints": found}) if found else self
        return settings, settings.motion_of(trajectory, control_frequency_hz)

    def motion_of(self, trajectory: Trajectory, control_frequency_hz: float) -> Motion:
        """The motion of a recording, its gripper open where the task says so.

        Args:
            control_frequency_hz: of a trajectory without timestamps.
        """
        return Motion.of(trajectory.with_gripper_open_above(self.gripper_open_above_m), control_frequency_hz)

    def check_models(self, names: Iterable[str]) -> None:
        """Refuse models, aliases and symmetries of objects that are not among the task's `names`."""
        known = list(names)
        check_aliases_of(self.aliases, known)
        for one, other in spelling_variants((*known, *self.yaw_symmetry_deg)):
            raise InvalidInputError(f"yaw_symmetry_deg[{other}]", f"is {one!r} in another spelling", one)
        for name in self.yaw_symmetry_deg.keys() - known:
            raise InvalidInputError(f"yaw_symmetry_deg[{name}]", "is no object of the task", ", ".join(known))
        for name in self.object_models:
            if name not in known:
                raise ObjectModelError(name, "is no object of the task", ", ".join(known))

    def canonical(self, poses: Iterable[ObjectPose]) -> tuple[ObjectPose, ...]:
        """The poses with each symmetric object turned to its canonical yaw."""
        return tuple(canonical_pose(pose, self.yaw_symmetry_deg.get(pose.name)) for pose in poses)
