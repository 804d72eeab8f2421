"""The hand of a scene of robosuite, or of what is built on it: how it is moved, and what a recorder sees of it.

Positions are in meters in robosuite's world frame; quaternions are xyzw. The hand's frame is robosuite's grip site: z
points out of the fingers, which close along x.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from app.sim.outcomes import RecordedDemonstration, RolloutResult, SceneView
from roboprompt_client.types.gripper import MIN_TRAVEL_M, open_by_width
from roboprompt_client.types.poses import EndEffectorAction
from roboprompt_client.types.trajectory import Trajectory

Floats = NDArray[np.float64]
CONTROL_HZ = 20.0
STEP_M, STEP_RAD = 0.05, 0.5  # the motions that OSC_POSE makes of a command of 1
OPEN, CLOSE = -1.0, 1.0  # the gripper's command
MAX_STEPS = 1500
SETTLING_STEPS = 10  # in which the objects fall onto the table
ARRIVED_M, ARRIVED_RAD = 0.004, 0.03
PASSED_M, PASSED_RAD = 0.015, 0.1  # where the gripper does not switch
MOVE_STEPS, GRIP_STEPS, LAST_STEPS = 150, 12, 30
EXPERT_SPEED = 0.4  # of the fastest, as people go


class ControlledScene:
    """A scene under way, whose hand the controller OSC_POSE moves; what happens follows from the commands.

    Args:
        env: robosuite's environment, just reset.
        site: the grip site.
        fingers: the indices of the two fingers' positions.
        joints: those of the arm's velocities.

    Attributes:
        after_success_steps: so long the arm goes on.
    """

    after_success_steps: ClassVar[int] = 12

    def __init__(self, env: Any, site: int, fingers: Sequence[int], joints: Sequence[int]) -> None:  # noqa: ANN401
        self.env, self._site, self._fingers, self._joints = env, site, list(fingers), list(joints)
        self.steps = 0
        self.done = False
        self._after = 0
        for _ in range(SETTLING_STEPS):
            self.env.step(np.array([0, 0, 0, 0, 0, 0, OPEN]))

    @property
    def ended(self) -> bool:
        """Whether nothing moves any more."""
        return self._after >= self.after_success_steps or self.steps >= MAX_STEPS

    @property
    def hand_m(self) -> Floats:
        """(3,) where the grip site is."""
        return np.array(self.env.sim.data.site_xpos[self._site])

    @property
    def hand(self) -> Rotation:
        """How the grip site is turned."""
        return Rotation.from_matrix(self.env.sim.data.site_xmat[self._site].reshape(3, 3))

    @property
    def width_m(self) -> float:
        """Between the fingers."""
        qpos = self.env.sim.data.qpos[self._fingers]
        return float(qpos[0] - qpos[1])

    @property
    def joint_velocities_rad_s(self) -> Floats:
        """(7,)."""
        return np.array(self.env.sim.data.qvel[self._joints])

    @property
    def model(self) -> Any:  # noqa: ANN401
        """MuJoCo's own model."""
        return self.env.sim.model._model

    @property
    def data(self) -> Any:  # noqa: ANN401
        """MuJoCo's own data."""
        return self.env.sim.data._data

    def pose_of(self, body: str) -> tuple[Floats, Floats]:
        """Return the position (3,) and quaternion (4,) of a body."""
        data, number = self.env.sim.data, self.env.sim.model.body_name2id(body)
        wxyz = np.array(data.body_xquat[number])
        return np.array(data.body_xpos[number]), wxyz[[1, 2, 3, 0]]

    def step(self, target_m: Floats, target: Rotation, gripper: float, fastest: float = 1.0) -> None:
        """One control step towards a pose; soon after success, or after too many steps, nothing moves.

        Args:
            target_m: (3,).
            fastest: the share of the controller's fastest motion.
        """
        if self.ended:
            return
        way = (target_m - self.hand_m) / STEP_M
        turn = (target * self.hand.inv()).as_rotvec() / STEP_RAD
        limited = [part * min(1.0, fastest / max(float(np.abs(part).max()), 1e-9)) for part in (way, turn)]
        self.env.step(np.concatenate([*limited, [gripper]]))
        self.steps += 1
        self.done = self.done or bool(self.env._check_success())
        self._after += self.done

    def off(self, target_m: Floats, target: Rotation) -> tuple[float, float]:
        """How far the hand is from a pose, in meters and radians."""
        return float(np.linalg.norm(target_m - self.hand_m)), float((target * self.hand.inv()).magnitude())


class Arm:
    """The hand under way, and what a recorder sees of it."""

    def __init__(self, scene: ControlledScene, fastest: float = 1.0) -> None:
        self._scene = scene
        self._fastest = fastest
        self._gripper = OPEN
        self._rows: list[tuple[Floats, Floats, Floats, float]] = []
        self._note()

    def carry_out(self, actions: Sequence[EndEffectorAction]) -> RolloutResult:
        """Go straight from one pose to the next, and say whether the scene was solved."""
        for number, action in enumerate(actions, start=1):
            self._perform(action, is_last=number == len(actions))
        failure = "" if self._scene.done else f"not solved after {self._scene.steps} steps"
        return RolloutResult(len(actions), self._scene.done, failure)

    def trajectory(self) -> Trajectory:
        """What was recorded; joints are not known to robots that are driven by poses alone, but here they are."""
        velocities, places_m, turns, widths_m = (np.array(column) for column in zip(*self._rows, strict=True))
        return Trajectory(velocities, places_m, turns, gripper_open(widths_m))

    def _perform(self, action: EndEffectorAction, *, is_last: bool) -> None:
        """Go straight to the action's pose, then open or close."""
        command = OPEN if action.gripper_open else CLOSE
        switches = command != self._gripper
        target = Rotation.from_quat(action.quaternion_xyzw)
        within = (ARRIVED_M, ARRIVED_RAD) if switches or is_last else (PASSED_M, PASSED_RAD)
        for _ in range(MOVE_STEPS):
            if all(np.less(self._scene.off(action.position_m, target), within)):
                break
            self._step(action.position_m, target)
        self._gripper = command
        for _ in range(LAST_STEPS if is_last else GRIP_STEPS if switches else 0):
            self._step(action.position_m, target)

    def _step(self, position_m: Floats, target: Rotation) -> None:
        if not self._scene.ended:
            self._scene.step(position_m, target, self._gripper, self._fastest)
            self._note()

    def _note(self) -> None:
        scene = self._scene
        row = scene.joint_velocities_rad_s, scene.hand_m, scene.hand.as_quat(), scene.width_m
        self._rows.append(row)


def demonstrated(view: SceneView, scene: ControlledScene, actions: list[EndEffectorAction]) -> RecordedDemonstration:
    """Carry out an expert's actions in a scene, of which this was seen, and return what was recorded."""
    arm = Arm(scene, EXPERT_SPEED)
    done = arm.carry_out(actions)
    return RecordedDemonstration(view, arm.trajectory(), CONTROL_HZ, done.succeeded, done.failure, tuple(actions))


def gripper_open(widths_m: Floats) -> NDArray[np.bool_]:
    """(T,) whether the gripper is open; fingers that hardly move are.

    Args:
        widths_m: (T,) between the fingers.
    """
    if np.ptp(widths_m) < MIN_TRAVEL_M:
        return np.ones(len(widths_m), np.bool_)
    return open_by_width(widths_m)
