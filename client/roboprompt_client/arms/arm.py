"""An arm as a Robot: checked before it moves, compared afterwards, and still once it was stopped."""

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from roboprompt_client.arms.driver import ArmState, Calibration, Driver, Guidable, Steerable
from roboprompt_client.arms.geometry import Geometry, KnowsItsJoints
from roboprompt_client.arms.preview import Previewed, preview_plan
from roboprompt_client.arms.tolerance import Tolerance, problem_ahead
from roboprompt_client.cameras.rig import SETTLE_S, Rig
from roboprompt_client.errors import InvalidInputError, MotionError, NotConfirmedError, UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Observation
from roboprompt_client.runs.live import OnLost
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, Pose

ConfirmViewpoint = Callable[[int, Pose], bool]
Steer = Callable[[Array, Array], str]
log = logging.getLogger(__name__)
MAX_START_S = 0.2
TOLERANCE = Tolerance()


class Arm:
    """An arm behind the Robot Protocol; once it was stopped, or a motion failed, it moves no more until `recover`.

    Args:
        observe_scene: what there is to see, in the world frame; None: nothing.
        limits: of the cell, in the world frame: held before every motion, whatever the service says.
        open_width_m: what the fingers measure when they are open; None: as wide as they were ever measured.
        geometry: of its joints, for the preview; None: the driver's own, if it has one.
        reach_m: how far from its base the hand gets, for the preview of an arm whose joints are not known.
        cameras: whose pictures `observe` takes.
        viewpoints: to which the hand goes for the pictures of cameras that it carries.
        on_lost: what a watched run does without the service (`Live`).

    Raises:
        InvalidInputError: for a bound of forces where the driver reports none.

    Attributes:
        to_find: the names of objects that the service is to find in the pictures, as `Observation` has them.
        confirm_viewpoint: asked before the hand goes to a viewpoint, with its number from 1; None: nothing is asked.
    """

    def __init__(
        self,
        driver: Driver,
        *,
        calibration: Calibration | None = None,
        observe_scene: Callable[[], Observation] | None = None,
        limits: MotionLimits | None = None,
        tolerance: Tolerance = TOLERANCE,
        open_width_m: float | None = None,
        geometry: Geometry | None = None,
        reach_m: float | None = None,
        cameras: Rig | None = None,
        viewpoints: Sequence[Pose] = (),
        on_lost: OnLost = "continue",
    ) -> None:
        self.driver, self.on_lost = driver, on_lost
        self.cameras, self.viewpoints = cameras, tuple(viewpoints)
        self.to_find: tuple[str, ...] = ()
        self.confirm_viewpoint: ConfirmViewpoint | None = None
        self._calibration = calibration or Calibration.none()
        self._limits = limits or MotionLimits(hand_radius_m=0.0)
        self._observe_scene, self._tolerance = observe_scene, tolerance
        self._stopped, self._moving = threading.Event(), threading.Lock()
        self._starting = threading.Lock()  # a stop comes before a motion begins or after it, never in between
        self._open_width_m = open_width_m
        self._geometry, self._reach_m = geometry, reach_m
        if tolerance.max_contact_force_n is not None and driver.state().wrench_n_nm is None:
            remedy = "an arm that reports them, such as a Franka or UR"
            raise InvalidInputError("max_contact_force_n", f"is set, but {driver.name} reports no forces", remedy)
        if not driver.proven:
            log.warning("%s: untested on hardware: keep a hand on the emergency stop", driver.name)

    def __enter__(self) -> "Arm":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop, and leave the arm."""
        self.stop()
        self.driver.close()
        if self.cameras is not None:
            self.cameras.close()

    def hand_to_world(self) -> Array:
        """The hand's pose (4, 4) in the world now."""
        return self.state().matrix()

    def state(self) -> ArmState:
        """The arm as it is now, in the world frame; safe to call from another thread."""
        return self._calibration.state_to_world(self.driver.state())

    def look_around(self) -> tuple[RgbdFrame, ...]:
        """The frames of all cameras (`Rig.look_around`); the hand goes to the viewpoints.

        Raises:
            CameraError: naming the camera whose picture cannot be used.
            NotConfirmedError: if a person did not let the hand go to a viewpoint; else as `execute`.
        """
        if self.cameras is None:
            return ()
        return self.cameras.look_around(self.hand_to_world, self.viewpoints, self._go_to_viewpoint)

    def _go_to_viewpoint(self, number: int, pose: Pose) -> None:
        if self.confirm_viewpoint is not None and not self.confirm_viewpoint(number, pose):
            raise NotConfirmedError(f"viewpoint {number} was not allowed: there is no picture from it")
        self.go_to(pose)
        time.sleep(SETTLE_S)

    def observe(self) -> Observation:
        """The scene as it is now; the hand goes to the viewpoints first. Raises as `look_around`."""
        frames = self.look_around()
        if self.cameras is not None and self.cameras.table is not None:
            self.cameras.table.check(frames)
        seen = Observation() if self._observe_scene is None else self._observe_scene()
        known = {item.name for item in seen.objects}
        to_find = dict.fromkeys((*seen.to_find, *(name for name in self.to_find if name not in known)))
        return Observation(seen.objects, (*seen.frames, *frames), to_find, self.state().pose(), seen.mask_ids)

    def preview(self, actions: Sequence[EndEffectorAction], limits: MotionLimits) -> tuple[Previewed, ...]:
        """What a plan asks of the arm from where it is; nothing moves. Raises MotionError if the arm does not answer.

        Args:
            limits: of the task; the way is checked against its boxes and the cell's.
        """
        state, geometry = self.state(), self._geometry
        if geometry is None and isinstance(self.driver, KnowsItsJoints):
            geometry = self.driver.geometry()
        boxes = (*self._limits.keep_out, *limits.keep_out)
        return preview_plan(
            actions,
            self._calibration,
            MotionLimits(keep_out=boxes, hand_radius_m=max(self._limits.hand_radius_m, limits.hand_radius_m)),
            geometry=geometry,
            reach_m=self._reach_m,
            joints_rad=state.joint_positions_rad,
            start_m=state.position_m.tolist(),
        )

    def _check_reach(self, action: EndEffectorAction) -> tuple[Array, Array]:
        """The action's pose in the base frame; raises MotionError if it is out of reach."""
        pose = self._calibration.to_base(action.position_m, action.quaternion_xyzw)
        self.driver.check(*pose)
        return pose

    def execute(self, action: EndEffectorAction) -> None:
        """Move, and set the gripper.

        Raises:
            UnsafeActionError: if the action is beyond the cell's limits; nothing moved.
            MotionError: before any motion if the pose is out of reach or the arm was stopped; afterwards if arm or
                gripper did not do as commanded. The arm is stopped.
        """
        with self._alone():
            before_m = self._move(action).gripper_width_m
            self.driver.set_gripper(is_open=action.gripper_open)
            self._refuse_if_stopped()
            width_m = self.driver.state().gripper_width_m
            if width_m is not None and before_m is not None:
                self._open_width_m = max(width_m, before_m, self._open_width_m or 0.0)
                self._tolerance.check_gripper(width_m, self._open_width_m, is_open=action.gripper_open)

    def go_to(self, pose: Pose) -> None:
        """Move as `execute` does, and leave the gripper as it is; raises as `execute`."""
        with self._alone():
            self._move(_at(pose))

    def problem_with(self, pose: Pose) -> str:
        """Why the hand cannot go to a pose; empty: nothing is known."""
        there = _at(pose)
        try:
            MotionGuard(self._limits, before=self.state().pose()).check(there)
            self._check_reach(there)
        except (UnsafeActionError, MotionError) as error:
            return str(error)
        return self.preview([there], MotionLimits(hand_radius_m=0.0))[0].warning

    @contextmanager
    def guided(self) -> Iterator[None]:
        """While it lasts a person moves the arm by hand; it holds still afterwards.

        Raises:
            InvalidInputError: if the driver cannot do so.
            MotionError: if the arm moves, was stopped, or refuses; the arm is stopped.
        """
        if not isinstance(self.driver, Guidable):
            raise InvalidInputError("guide", f"{self.driver.name} cannot be guided by its driver", "its maker's button")
        with self._alone():
            self._refuse_if_stopped()
            with self.driver.guided():
                yield
            self._refuse_if_stopped()

    @contextmanager
    def steered(self) -> Iterator[Steer]:
        """While it lasts a person steers the hand; it rests afterwards. Raises as `guided`.

        Yields a function of a velocity (3,) m/s and a turning (3,) rad/s along and about the world's axes: the hand
        moves so for 0.15 s at most. It returns why the hand rests instead, such as a bound of the cell ahead.
        """
        if not isinstance(driver := self.driver, Steerable):
            raise InvalidInputError("teleop", f"{driver.name} cannot be steered by its driver", "another arm")

        def steer(velocity_m_s: Array, turning_rad_s: Array) -> str:
            now, back = self.state(), rotations.inverse(self._calibration.quaternion_xyzw)
            problem = self._tolerance.contact(now, velocity_m_s)
            problem = problem or problem_ahead(now, velocity_m_s, turning_rad_s, self._limits, self._check_reach)
            wanted = (np.zeros(3), np.zeros(3)) if problem else (velocity_m_s, turning_rad_s)
            with self._starting:
                self._refuse_if_stopped()
                driver.steer(*(rotations.rotated(back, vector) for vector in wanted))
            return problem

        with self._alone():
            yield steer
            steer(np.zeros(3), np.zeros(3))
            self._wait(replace(self._tolerance, max_contact_force_n=None))  # what it rests against is no error

    def set_gripper(self, *, is_open: bool) -> None:
        """Open or close the gripper where the arm is, also while it is guided; raises MotionError once stopped."""
        self._refuse_if_stopped()
        self.driver.set_gripper(is_open=is_open)

    def stop(self) -> None:
        """Hold still, from any thread; what was moving raises MotionError, and nothing moves until `recover`."""
        self._stopped.set()
        begun = self._starting.acquire(timeout=MAX_START_S)  # a driver that hangs must not keep the stop from it
        try:
            self.driver.halt()
        except MotionError as error:
            log.error("%s: the stop was not confirmed: %s", self.driver.name, error)
        finally:
            if begun:
                self._starting.release()

    def recover(self) -> None:
        """Let the arm move again, after a person has looked; acknowledges the arm's own errors, too."""
        self.driver.recover()
        self._stopped.clear()

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """One motion at a time; the arm is stopped where it goes wrong."""
        if not self._moving.acquire(blocking=False):
            raise MotionError("the arm is in a motion that another thread began")
        try:
            yield
        except BaseException:
            self.stop()
            raise
        finally:
            self._moving.release()

    def _move(self, action: EndEffectorAction) -> ArmState:
        """Go to the action's pose; returns the arm as it was before."""
        self._refuse_if_stopped()
        before = self.state()
        MotionGuard(self._limits, before=before.pose()).check(action)
        wanted = self._check_reach(action)
        with self._starting:
            self._refuse_if_stopped()
            self.driver.start(*wanted)
        self._refuse_if_stopped()
        self._wait(self._tolerance)
        self._tolerance.check_pose(self.state(), action)
        self._refuse_if_stopped()
        return before

    def _refuse_if_stopped(self) -> None:
        if self._stopped.is_set():
            raise MotionError("the arm was stopped: call recover() once a person has looked")

    def _wait(self, tolerance: Tolerance) -> None:
        end_s = time.monotonic() + tolerance.motion_s
        while not self.driver.finished():
            self._refuse_if_stopped()
            tolerance.check_contact(self.state)
            if time.monotonic() > end_s:
                raise MotionError(f"the motion did not end within {tolerance.motion_s:g} s")
        self._refuse_if_stopped()


def _at(pose: Pose) -> EndEffectorAction:
    return EndEffectorAction(np.array(pose.position_m), np.array(pose.quaternion_xyzw), gripper_open=True)
