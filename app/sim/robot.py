"""The simulated arm as a Robot: observes its scene, carries out actions; a sampler records what it does."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.motion import time_path
from app.sim.moves import Move, ToolPose
from app.sim.planner import JointPath, Kinematics, Planner
from app.sim.rendering import open_renderer
from app.sim.tasks.base import SimTask
from app.sim.world import BASE_POSITION_M, CAMERA_NAMES, TIMESTEP_S
from roboprompt_client.errors import MotionError
from roboprompt_client.robot import Observation
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import EndEffectorAction, Pose
from roboprompt_client.types.trajectory import Trajectory

GRIPPER_S = 0.5  # the Franka Hand closes at up to 0.1 m/s (data sheet): 0.4 s for its whole travel, and time to grip
STOP_S = 0.1
DWELL_S = 0.1  # after each move: two samples of a recording, so that keyframe rules see it
# An arm that ends up further from its target has run into something.
MAX_MISS_M, MAX_MISS_RAD = 0.03, np.radians(15.0)
# A position servo trails by velocity * damping / stiffness; asking that much ahead cancels it (44 mm become 0.9 mm).
VELOCITY_LEAD_S = panda.SERVO_DAMPING / panda.SERVO_STIFFNESS

GripperState = Literal["measured", "commanded"]
CONTROL_FREQUENCY_HZ = 20.0  # of recordings, as RLBench's
TIME_TOLERANCE_S = 1e-9
MIN_FINGER_TRAVEL_M = 1e-3  # fingers that move less have neither opened nor closed


class SimulatedPanda:
    """A Panda in a task's scene; implements `roboprompt_client.robot.Robot`. Simulated time passes only while it acts.

    Args:
        task: the scene; the arm is where its data says.
        cameras: which cameras `observe` renders; none makes it much quicker.

    Attributes:
        after_step: called after every simulation step, e.g. a recorder's `sample`.
        after_move: called with the index of each of the moves that `perform` was given, once it is done.
    """

    def __init__(self, task: SimTask, cameras: Sequence[str] = CAMERA_NAMES) -> None:
        self.task = task
        self.cameras = tuple(cameras)
        self.after_step: list[Callable[[], None]] = [task.latch]
        self.after_move: list[Callable[[int], None]] = []
        self._kinematics = Kinematics(BASE_POSITION_M)
        self._planner = Planner(self._kinematics)
        self._joint_addresses = [task.model.joint(name).qposadr[0] for name in panda.JOINT_NAMES]
        self._target_rad: Array = task.data.ctrl[: panda.NUM_JOINTS].copy()

    @property
    def gripper_commanded_open(self) -> bool:
        """Whether the gripper was last commanded open."""
        return bool(self.task.data.ctrl[panda.GRIPPER_CTRL] > panda.FINGER_TRAVEL_M / 2)

    def observe(self) -> Observation:
        task, hand = self.task, self.hand
        end_effector = Pose(hand.position_m, hand.rotation.as_quat())
        if not self.cameras:
            return Observation(task.object_poses(), end_effector=end_effector)
        with open_renderer(task.model) as renderer:
            frames = tuple(renderer.rgbd(task.data, name) for name in self.cameras)
        return Observation(task.object_poses(), frames, end_effector=end_effector)

    def execute(self, action: EndEffectorAction) -> None:
        """Move in a straight line where the arm can, then set the gripper; raises MotionError as the Protocol says."""
        pose = ToolPose(action.position_m, Rotation.from_quat(action.quaternion_xyzw))
        self.perform([Move(pose, action.gripper_open)])

    def perform(self, moves: Sequence[Move]) -> None:
        """Carry out moves planned as a whole; those that are straight, where the arm can.

        Raises:
            MotionError: before any motion if a pose is out of reach; later if one is not arrived at. Names the move.
        """
        paths = self._planner.plan(self._target_rad, moves)
        for index, (move, path) in enumerate(zip(moves, paths, strict=True)):
            self._follow(path)
            self._check_arrival(move.pose, index, len(moves))
            self._set_gripper(is_open=move.gripper_open)
            self._end_move(index)

    def _end_move(self, index: int) -> None:
        for call in self.after_move:
            call(index)

    def stop(self) -> None:
        self._target_rad = self.task.data.qpos[self._joint_addresses]
        self.hold(STOP_S)

    def hold(self, duration_s: float) -> None:
        """Rest at the commanded position while simulated time passes."""
        steps = round(duration_s / TIMESTEP_S)
        self._run(np.tile(self._target_rad, (steps, 1)))

    def _follow(self, path: JointPath) -> None:
        motion = time_path(path, self._kinematics, TIMESTEP_S)
        self._target_rad = path.end_rad
        self._run(motion.positions_rad + VELOCITY_LEAD_S * motion.velocities_rad_s)
        self.hold(DWELL_S)

    def _set_gripper(self, *, is_open: bool) -> None:
        width_m = panda.FINGER_TRAVEL_M if is_open else 0.0
        if width_m != self.task.data.ctrl[panda.GRIPPER_CTRL]:
            self.task.data.ctrl[panda.GRIPPER_CTRL] = width_m
            self.hold(GRIPPER_S)

    def _run(self, targets_rad: Array) -> None:
        """One simulation step for each row (N, 7)."""
        model, data = self.task.model, self.task.data
        arm_ctrl = data.ctrl[: panda.NUM_JOINTS]
        for row in targets_rad:
            arm_ctrl[:] = row
            mujoco.mj_step(model, data)
            for call in self.after_step:
                call()

    @property
    def hand(self) -> ToolPose:
        """The pose of the end effector."""
        return self._kinematics.forward(self.task.data.qpos[self._joint_addresses])

    def _check_arrival(self, wanted: ToolPose, index: int, total: int) -> None:
        miss_m, miss_rad = self.hand.apart(wanted)
        if miss_m > MAX_MISS_M or miss_rad > MAX_MISS_RAD:
            miss = f"{miss_m * 100:.1f} cm and {np.degrees(miss_rad):.0f} degrees off: something is in the way"
            raise MotionError(f"action {index + 1} of {total} did not arrive, {miss}")


class TrajectorySampler:
    """Samples an arm and its scene at CONTROL_FREQUENCY_HZ, from now on.

    Args:
        tracked: names of the bodies of the objects to be tracked.
    """

    def __init__(self, robot: SimulatedPanda, tracked: Sequence[str] = ()) -> None:
        model, data = robot.task.model, robot.task.data
        self._robot, self._model, self._data = robot, model, data
        self._tracked = [model.body(name).id for name in tracked]
        self._next_s = data.time
        self._positions = [model.joint(name).qposadr[0] for name in panda.JOINT_NAMES]
        self._fingers = [model.joint(name).qposadr[0] for name in panda.FINGER_NAMES]
        self._velocities = [model.joint(name).dofadr[0] for name in panda.JOINT_NAMES]
        self._site_id = model.site(panda.TCP_SITE).id
        self._rows: list[dict[str, Any]] = []
        self.sample()
        robot.after_step.append(self.sample)

    def sample(self) -> None:
        """Take a sample if one is due; called after every simulation step."""
        if self._data.time < self._next_s - TIME_TOLERANCE_S:
            return
        self._next_s += 1 / CONTROL_FREQUENCY_HZ
        data = self._data
        mujoco.mj_kinematics(self._model, data)  # mj_step leaves body poses one step behind the joints
        row = {
            "timestamps_s": data.time,
            "joint_velocities_rad_s": data.qvel[self._velocities],
            "joint_positions_rad": data.qpos[self._positions],
            "positions_m": data.site_xpos[self._site_id].copy(),
            "rotations": data.site_xmat[self._site_id].reshape(3, 3).copy(),
            "gripper_open": self._robot.gripper_commanded_open,
            "widths_m": data.qpos[self._fingers].sum(),
            "object_positions_m": data.xpos[self._tracked],
            "object_axes": data.xmat[self._tracked],
        }
        self._rows.append(row)

    def trajectory(self, gripper: GripperState = "commanded") -> Trajectory:
        """Return the samples so far as a trajectory.

        Args:
            gripper: whether its state is what the fingers have done, or what they were commanded; see `measured_open`.
        """
        columns = {key: np.array([row[key] for row in self._rows]) for key in self._rows[0]}
        rotations = Rotation.from_matrix(columns.pop("rotations"))
        widths_m = columns.pop("widths_m")
        positions_m, axes = columns.pop("object_positions_m"), columns.pop("object_axes").reshape(-1, 3, 3)
        if self._tracked:
            columns["object_positions_m"] = positions_m
            # All at once: one rotation takes as long as a thousand.
            turns_xyzw = Rotation.from_matrix(axes).as_quat(canonical=True)
            columns["object_quaternions_xyzw"] = turns_xyzw.reshape(*positions_m.shape[:2], 4)
        if gripper == "measured":
            columns["gripper_open"] = measured_open(widths_m)
        return Trajectory(quaternions_xyzw=rotations.as_quat(), **columns)


def measured_open(widths_m: Array) -> npt.NDArray[np.bool_]:
    """Whether the gripper is open (T,), from the widths (T,) between its fingers over a whole recording.

    It is open above the middle between the narrowest and the widest of them: fingers that hold something are closed,
    however thick it is. Fingers that never move are open if they are more than half open.
    """
    narrowest_m, widest_m = widths_m.min(), widths_m.max()
    moves = widest_m - narrowest_m > 2 * MIN_FINGER_TRAVEL_M
    middle_m = (narrowest_m + widest_m) / 2 if moves else panda.FINGER_TRAVEL_M
    is_open: npt.NDArray[np.bool_] = widths_m > middle_m
    return is_open
