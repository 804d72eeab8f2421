"""The makers' interfaces as they document them, over a point that moves in straight lines.

Units and return values are theirs: franky meters and x y z w, UR meters and rotation vectors.
"""

import time
from types import SimpleNamespace as Named

import numpy as np

from roboprompt_client.arms.driver import ArmState
from roboprompt_client.arms.franka import Franka
from roboprompt_client.arms.named import flange
from roboprompt_client.arms.ur import UR
from roboprompt_client.errors import MotionError
from roboprompt_client.types import quaternions as rotations

DOWN = np.array([1.0, 0, 0, 0])
READY_RAD = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
FIRST_M = flange(READY_RAD)[0][:3, 3]
STEPS = 4  # polls that a motion takes
OPEN_M = 0.08


class Body:
    """Where the tool is. `blocked` stops it on its way, `jammed` the fingers, `gone` every answer.

    `on_touch` is called whenever a maker's interface asks or commands something.
    """

    def __init__(self):
        self.on_touch = lambda: None
        self._position_m, self.quaternion = FIRST_M.copy(), DOWN.copy()
        self.width_m = OPEN_M
        self.force_n = np.zeros(3)
        self.blocked = self.jammed = self.gone = self.halted = False
        self.slips = False  # the maker's interface says that a grasp has failed
        self.starts = self.halts = self.let_go = 0
        self.closed, self.fault = False, ""  # the error that a plain arm reports
        self.tool = np.eye(4)  # in the flange's frame
        self.unplanned, self.error = 0, None  # motions that franky's planner fails to plan; raised until it is joined
        self._left = 0

    @property
    def position_m(self):
        self.on_touch()
        return self._position_m

    @position_m.setter
    def position_m(self, position_m):
        self.on_touch()
        self._position_m = position_m

    def go(self, position_m, quaternion):
        self.on_touch()
        self.starts += 1
        self.halted = False
        self._goal, self._from, self._left = (np.array(position_m), quaternion), self._position_m, STEPS

    def poll(self):
        """Whether it moves."""
        self.on_touch()
        if self._left == 0 or self.halted:
            return False
        self._left -= 1
        if not (self.blocked and self._left < STEPS / 2):
            self._position_m = self._from + (self._goal[0] - self._from) * (1 - self._left / STEPS)
            self.quaternion = self._goal[1]
        return self._left > 0

    def halt(self):
        self.halts += 1
        self.halted = True

    def where(self):
        return [round(float(value), 9) for value in (*self._position_m, *self.quaternion, self.width_m)]

    def grip(self, width_m):
        self.on_touch()
        if not self.jammed:
            self.width_m = width_m


class NetworkException(Exception):  # noqa: N818
    pass


def franky(body):
    def answer(value):
        if body.gone:
            raise NetworkException("TCP receive: Connection reset by peer")
        return value

    def fail_to_plan():
        if body.unplanned:
            body.unplanned -= 1
            body.error = RuntimeError("Motion planner failed with error code -111")
            raise body.error

    class Robot:
        def __init__(self, address, relative_dynamics_factor, realtime_config):
            assert 0 < relative_dynamics_factor <= 0.05

        has_errors = property(lambda self: answer(False))
        current_joint_state = property(lambda self: answer(Named(position=READY_RAD, velocity=np.zeros(7))))

        @property
        def current_pose(self):
            return answer(Named(end_effector_pose=Named(translation=body.position_m, quaternion=body.quaternion)))

        @property
        def state(self):
            return answer(
                Named(
                    F_T_EE=Named(matrix=body.tool),
                    O_F_ext_hat_K=[*body.force_n, 0.0, 0.0, 0.5],
                    time=Named(to_sec=time.monotonic),
                )
            )

        def move(self, motion, asynchronous):
            assert asynchronous
            answer(None)
            if body.error is not None:
                raise body.error
            body.go(*motion)

        def poll_motion(self):
            """Whether the motion has ended, whatever its docstring says."""
            answer(None)
            if body.error is not None:
                raise body.error
            fail_to_plan()
            return not body.poll()

        def join_motion(self, timeout):
            body.error = None
            return True

        def stop(self):
            body.halt()
            answer(None)

        def recover_from_errors(self):
            return answer(True)

    class Gripper:
        def __init__(self, address):
            pass

        max_width, is_grasped = OPEN_M, False
        width = property(lambda self: answer(body.width_m))

        def open(self, speed):
            body.grip(OPEN_M)

        def grasp(self, width, speed, force, epsilon_inner, epsilon_outer):
            body.grip(0.0)
            if body.slips:
                raise RuntimeError("libfranka gripper: Command failed!")

        def stop(self):
            body.let_go += 1

    return Named(
        Robot=Robot,
        Gripper=Gripper,
        RealtimeConfig=Named(Enforce=0, Ignore=1),
        Affine=lambda translation, quaternion: (translation, quaternion),
        CartesianMotion=lambda target, relative_dynamics_factor: target,
        NetworkException=NetworkException,
    )


def rtde(body):
    """The modules control, receive and io."""
    now = Named(progress=-1, before=-1)

    def progress():
        """Toggles between -1 and -2 with each operation that ends."""
        if now.progress >= 0 and not body.poll():
            now.progress = -3 - now.before
        return now.progress

    def move(pose, speed, acceleration, asynchronous):
        assert asynchronous
        assert speed <= 0.1
        now.before, now.progress = now.progress, 0
        body.go(pose[:3], rotations.from_rotation_vector(pose[3:]))
        return True

    control = Named(
        isConnected=lambda: not body.gone,
        isPoseWithinSafetyLimits=lambda pose: bool(np.linalg.norm(pose[:3]) < 0.85),
        getInverseKinematics=lambda pose: [0.1] * 6,
        getTCPOffset=lambda: [
            *body.tool[:3, 3],
            *rotations.to_rotation_vector(rotations.from_matrix(body.tool[:3, :3])),
        ],
        isJointsWithinSafetyLimits=lambda joints: True,
        getAsyncOperationProgress=progress,
        moveL=move,
        stopL=lambda deceleration: body.halt(),
        stopScript=lambda: None,
        disconnect=lambda: None,
        reconnect=lambda: not body.gone,
    )
    receive = Named(
        isConnected=lambda: not body.gone,
        getActualTCPPose=lambda: [*body.position_m, *rotations.to_rotation_vector(body.quaternion)],
        getActualQ=lambda: [0.1, -1.2, 1.4, -1.6, -1.6, 0.1],
        getActualQd=lambda: [0.0] * 6,
        getActualTCPForce=lambda: [*body.force_n, 0.0, 0.0, 0.5],
        getDigitalOutState=lambda number: {16: body.width_m == 0.0}[number],
        isEmergencyStopped=lambda: False,
        isProtectiveStopped=lambda: False,
        disconnect=lambda: None,
    )

    def output(number, level):
        body.grip(0.0 if level else OPEN_M)
        return not body.jammed

    outputs = Named(setToolDigitalOut=output)
    return (
        Named(RTDEControlInterface=lambda address: control),
        Named(RTDEReceiveInterface=lambda address: receive),
        Named(RTDEIOInterface=lambda address: outputs),
    )


class Plain:
    """A driver over the body itself, for tests of what stands above drivers."""

    name, proven = "plain", ""

    def __init__(self, body):
        self._body = body

    def state(self):
        if self._body.gone:
            raise MotionError("plain: the connection is lost")
        joints = np.full(7, 0.1)
        return ArmState(self._body.position_m, self._body.quaternion, joints, np.zeros(7), self._body.width_m)

    def check(self, position_m, quaternion_xyzw):
        if self._body.fault:
            raise MotionError(f"plain: {self._body.fault}")
        if np.linalg.norm(position_m) > 0.7:
            raise MotionError("the pose is out of reach")

    def start(self, position_m, quaternion_xyzw):
        self._body.go(position_m, quaternion_xyzw)

    def finished(self):
        return not self._body.poll()

    def set_gripper(self, *, is_open):
        self._body.grip(OPEN_M if is_open else 0.0)

    def halt(self):
        self._body.halt()

    def recover(self):
        self._body.fault = ""

    def close(self):
        self._body.closed = True


def open_franka(body, monkeypatch):
    monkeypatch.setattr("roboprompt_client.arms.franka.import_extra", lambda *_: franky(body))
    return Franka("127.0.0.1")


def open_ur(body, monkeypatch, **options):
    modules = iter(rtde(body))  # control, receive, io
    monkeypatch.setattr("roboprompt_client.arms.ur.import_extra", lambda *_: next(modules))
    return UR("127.0.0.1", gripper_output=0, gripper_s=0.0, **options)


MAKERS = {"franka": open_franka, "ur": open_ur}
