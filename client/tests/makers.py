"""The makers' interfaces as they document them, over a point that moves in straight lines.

Units and return values are theirs: franky meters and x y z w, UR meters and rotation vectors, xArm millimeters and
codes, LeRobot meters, rotation vectors and per cent.
"""

import time
from types import SimpleNamespace as Named

import numpy as np

from roboprompt_client.arms.franka import Franka
from roboprompt_client.arms.lerobot import LeRobotArm
from roboprompt_client.arms.panda import flange
from roboprompt_client.arms.ur import UR
from roboprompt_client.arms.xarm import XArm
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
        self.code = 0  # the error that an xArm's box reports
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

    def drift(self, velocity_m_s, turning_rad_s, for_s):
        """What a velocity does that nobody repeats."""
        self.on_touch()
        self._position_m = self._position_m + for_s * np.array(velocity_m_s)
        turn = rotations.from_rotation_vector(for_s * np.array(turning_rad_s))
        self.quaternion = rotations.product(turn, self.quaternion)

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

        translation_velocity_limit, rotation_velocity_limit = Named(get=lambda: 1.7), Named(get=lambda: 2.5)
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
            if isinstance(motion, list):
                fail_to_plan()
                assert motion[-1] == ((0, 0, 0), (0, 0, 0), 0)  # a motion must end at rest
                for velocity, turning, hold_ms in motion:
                    assert np.linalg.norm(velocity) < 0.05 * 1.7
                    assert np.linalg.norm(turning) < 0.05 * 2.5
                    body.drift(velocity, turning, hold_ms / 1000)
            else:
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
        CartesianVelocityWaypoint=lambda twist, hold_target_duration=0: (*twist, hold_target_duration),
        CartesianVelocityWaypointMotion=lambda points: points,
        Twist=lambda velocity=(0, 0, 0), turning=(0, 0, 0): (tuple(velocity), tuple(turning)),
        RobotVelocity=lambda twist: twist,
        Duration=lambda milliseconds: milliseconds,
        NetworkException=NetworkException,
    )


def rtde(body):
    """The modules control, receive and io."""
    now = Named(progress=-1, before=-1, servo=False)

    def progress():
        """Toggles between -1 and -2 with each operation that ends."""
        if now.progress >= 0 and not body.poll():
            now.progress = -3 - now.before
        return now.progress

    def move(pose, speed, acceleration, asynchronous):
        assert asynchronous
        assert speed <= 0.1
        assert not now.servo  # the controller: another thread is controlling the robot already
        now.before, now.progress = now.progress, 0
        body.go(pose[:3], rotations.from_rotation_vector(pose[3:]))
        return True

    def servo(pose, speed, acceleration, time, lookahead_time, gain):
        assert (0.03 <= lookahead_time <= 0.2, 100 <= gain <= 2000) == (True, True)
        now.servo = True
        body.position_m, body.quaternion = np.array(pose[:3]), rotations.from_rotation_vector(pose[3:])
        return True

    def stop(deceleration):
        """It does not end the servo thread, which `servoStop` does."""
        if not now.servo:
            body.halt()

    def servo_stop(deceleration):
        now.servo = False
        body.halt()
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
        servoL=servo,
        servoStop=servo_stop,
        stopL=stop,
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


def xarm(body):
    """Codes instead of exceptions; without is_radian=True angles would be degrees."""
    now = Named(state=4, mode=None)
    lost = 1  # a code other than 0

    def get_position(is_radian):
        pose = [*(1000 * body.position_m), *rotations.to_roll_pitch_yaw(body.quaternion)]
        return (lost if body.gone else 0), pose

    def set_position(x, y, z, roll, pitch, yaw, speed, mvacc, is_radian, wait):
        assert is_radian
        assert not wait
        if now.state == 4 or now.mode != 0:
            return 9  # not ready to move
        body.go(np.array([x, y, z]) / 1000, rotations.from_roll_pitch_yaw(roll, pitch, yaw))
        return 0

    def set_gripper_position(pulses, wait):
        assert wait
        body.grip(pulses / 10_000)
        return 0

    def set_state(state):
        now.state = state
        if state == 4:
            body.halt()
        return 0

    def set_mode(mode):
        now.mode = mode
        return 0

    def vc_set_cartesian_velocity(speeds, is_radian, is_tool_coord, duration):
        assert (is_radian, is_tool_coord) == (True, False)
        if (now.mode, now.state) != (5, 0):
            return 9
        body.drift(np.array(speeds[:3]) / 1000, speeds[3:], duration)
        return 0

    def opened(address, is_radian):
        assert is_radian
        return Named(
            get_position=get_position,
            get_joint_states=lambda is_radian: (0, [[0.1] * 7, [0.0] * 7, [0.0] * 7]),
            get_gripper_position=lambda: (0, int(body.width_m * 10_000)),
            get_err_warn_code=lambda: (0, [body.code, 0]),
            get_state=lambda: ((lost if body.gone else 0), 1 if body.poll() else 2),
            is_tcp_limit=lambda pose, is_radian: (0, bool(np.linalg.norm(pose[:3]) > 700)),
            get_inverse_kinematics=lambda pose, input_is_radian, return_is_radian: (0, [0.1] * 7),
            is_joint_limit=lambda joints, is_radian: (0, False),
            set_position=set_position,
            set_gripper_position=set_gripper_position,
            set_state=set_state,
            set_mode=set_mode,
            vc_set_cartesian_velocity=vc_set_cartesian_velocity,
            clean_error=lambda: setattr(body, "code", 0),
            clean_warn=lambda: 0,
            motion_enable=lambda enable: body.code,
            set_gripper_enable=lambda enable: 0,
            disconnect=lambda: None,
        )

    return Named(XArmAPI=opened)


class LeRobot:
    """An SO-101 with its kinematics: refuses what is more than 5 cm from where it is."""

    is_connected = True

    def __init__(self, body):
        self._body = body
        self._last = None

    def get_observation(self):
        if self._body.gone:
            raise ConnectionError("no status packet from motor 3")
        pose = [*self._body.position_m, *rotations.to_rotation_vector(self._body.quaternion)]
        named = dict(zip(("ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz"), pose, strict=True))
        joints = dict.fromkeys(("pan.pos", "lift.pos", "elbow.pos", "flex.pos", "roll.pos"), 5.0)
        return {**named, **joints, "gripper.pos": 50.0, "ee.gripper_pos": 100 * self._body.width_m / OPEN_M}

    def send_action(self, action):
        assert all(type(value) is float for value in action.values())
        goal = np.array([action[name] for name in ("ee.x", "ee.y", "ee.z")])
        if np.linalg.norm(goal - self._body.position_m) > 0.05 and not self._body.blocked:
            raise ValueError("EE jump 0.061m > 0.05m")
        if not np.allclose(goal, self._body.position_m) and not np.array_equal(goal, self._last):
            self._last = goal
            self._body.starts += 1
        if not self._body.blocked:
            self._body.position_m = goal
            self._body.quaternion = rotations.from_rotation_vector([action[f"ee.w{axis}"] for axis in "xyz"])
        self._body.grip(action["ee.gripper_pos"] / 100 * OPEN_M)
        return action

    def disconnect(self):
        pass


def open_franka(body, monkeypatch):
    monkeypatch.setattr("roboprompt_client.arms.franka.import_extra", lambda *_: franky(body))
    return Franka("127.0.0.1")


def open_ur(body, monkeypatch, **options):
    modules = iter(rtde(body))  # control, receive, io
    monkeypatch.setattr("roboprompt_client.arms.ur.import_extra", lambda *_: next(modules))
    return UR("127.0.0.1", gripper_output=0, gripper_s=0.0, **options)


def open_xarm(body, monkeypatch):
    monkeypatch.setattr("roboprompt_client.arms.xarm.import_extra", lambda *_: xarm(body))
    monkeypatch.setattr("roboprompt_client.arms.xarm.START_S", 0.0)
    return XArm("127.0.0.1")


def open_lerobot(body, monkeypatch):
    for name in ("SETTLE_S", "GRIPPER_S"):
        monkeypatch.setattr(f"roboprompt_client.arms.lerobot.{name}", 0.0)
    monkeypatch.setattr("roboprompt_client.arms.lerobot.RATE_HZ", 10_000.0)
    return LeRobotArm(LeRobot(body), reach_m=0.8, open_width_m=OPEN_M)


MAKERS = {"franka": open_franka, "ur": open_ur, "xarm": open_xarm, "lerobot": open_lerobot}
