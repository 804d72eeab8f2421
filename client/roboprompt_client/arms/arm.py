"""An arm as a `Robot`: limits are checked before each motion, the pose after it, and a stop holds until `recover`."""

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from roboprompt_client.arms.driver import LOOK_FIRST, ArmState, Calibration, Driver, Guidable
from roboprompt_client.arms.geometry import Chain, KnowsItsJoints
from roboprompt_client.arms.preview import Previewed, preview_plan
from roboprompt_client.cameras.rig import Rig
from roboprompt_client.errors import InvalidInputError, MotionError, UnsafeActionError
from roboprompt_client.motion.guard import MotionGuard
from roboprompt_client.motion.limits import MotionLimits, checked_bound
from roboprompt_client.robot import Observation
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import RgbdFrame
from roboprompt_client.types.poses import EndEffectorAction, Pose

log = logging.getLogger(__name__)
MAX_START_S = 0.2
NO_BOXES = MotionLimits(hand_radius_m=0.0)


class Interlock:
    """Gives commands to a driver. After a stop, or an error within `alone`, it gives none until `recover`."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._stopped, self._moving = threading.Event(), threading.Lock()
        self._starting = threading.Lock()  # held while a command is given

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Allow one motion at a time, and stop the arm if it fails."""
        if not self._moving.acquire(blocking=False):
            raise MotionError("another thread is moving the arm")
        try:
            yield
        except BaseException:
            self.stop()
            raise
        finally:
            self._moving.release()

    def begin(self, command: Callable[[], object]) -> None:
        """Give a command: a stop of another thread comes either before it or after it."""
        with self._starting:
            self.refuse_if_stopped()
            command()
        self.refuse_if_stopped()

    def wait(self, most_s: float, check: Callable[[], None] = lambda: None) -> None:
        """Wait for the end of a motion; raises MotionError after `most_s` or a stop, and what `check` raises."""
        end_s = time.monotonic() + most_s
        while not self._driver.finished():
            self.refuse_if_stopped()
            check()
            if time.monotonic() > end_s:
                raise MotionError(f"the motion did not end within {most_s:g} s")
        self.refuse_if_stopped()

    def refuse_if_stopped(self) -> None:
        """Raise MotionError after a stop."""
        if self._stopped.is_set():
            raise MotionError(f"the arm was stopped: {LOOK_FIRST}")

    def stop(self) -> None:
        """Stop, from any thread; an error of the driver is logged, so that it hides no other."""
        self._stopped.set()
        if not self._starting.acquire(blocking=False):
            self._halt()  # at once, and again after the command that another thread is giving
            if not self._starting.acquire(timeout=MAX_START_S):  # do not wait for a driver that hangs
                self._halt()
                return
        try:
            self._halt()
        finally:
            self._starting.release()

    def recover(self) -> None:
        """Let the arm move again; a stop meanwhile holds."""
        with self._starting:
            self._stopped.clear()
            try:
                self._driver.recover()
            except BaseException:
                self._stopped.set()
                raise

    def _halt(self) -> None:
        try:
            self._driver.halt()
        except Exception as error:  # of any kind, from a driver of the user's own
            log.error("%s: the stop was not confirmed: %s", self._driver.name, error or type(error).__name__)


@dataclass(frozen=True)
class Tolerance:
    """How exactly the end effector must arrive, how long a motion may take, and how much force it may meet.

    The force is checked about 20 times a second while the arm moves; None: not checked.

    Raises:
        InvalidInputError: for a bound that is not a finite number above 0.
    """

    position_m: float = 0.005
    rotation_deg: float = 2.0
    width_m: float = 0.004
    motion_s: float = 120.0
    max_contact_force_n: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            if (value := getattr(self, field.name)) is not None or field.default is not None:
                checked_bound(f"tolerance.{field.name}", value)

    def check_pose(self, state: ArmState, action: EndEffectorAction) -> None:
        """Raise MotionError if the end effector is not at the action's pose, both in the world frame."""
        off_m, off_deg = state.distance_to(action.position_m, action.quaternion_xyzw)
        if not (off_m <= self.position_m and off_deg <= self.rotation_deg):
            raise MotionError(f"the motion ended {1000 * off_m:.1f} mm and {off_deg:.1f} degrees off its target")

    def check_contact(self, state: Callable[[], ArmState]) -> None:
        """Raise MotionError if the hand meets too much force; `state` is called only if there is a bound."""
        if (most_n := self.max_contact_force_n) is not None and (now := state()).force_n > most_n:
            where_m = now.position_m.round(3).tolist()
            raise MotionError(f"the hand met {now.force_n:.1f} N at {where_m} m, at most {most_n:g} N are allowed")

    def check_gripper(self, width_m: float, open_width_m: float, *, is_open: bool) -> None:
        """Raise MotionError if the fingers, at least `open_width_m` apart when open, did not do as commanded."""
        if not math.isfinite(width_m):
            raise MotionError(f"the gripper's width is {width_m} m: whether it did as commanded is not known")
        is_closed, is_wide = width_m <= self.width_m, width_m >= open_width_m - self.width_m
        if is_open and (is_closed or not is_wide):
            of_mm = f"{1000 * width_m:.1f} of {1000 * open_width_m:.1f} mm"
            raise MotionError(f"the gripper was to open, but measures {of_mm}")
        if not is_open and is_wide and not is_closed:
            message = f"the gripper was to close, but still measures {1000 * width_m:.1f} mm"
            raise MotionError(f"{message} (if it held something before: give the cell `open_width_m`)")


TOLERANCE = Tolerance()


class Arm:
    """An arm that implements the Robot Protocol. After a stop or a failed motion it does not move until `recover`.

    Args:
        observe_scene: returns the objects in the world frame; None: there are none.
        limits: of the cell, in the world frame; checked before every motion, whatever the service allows.
        open_width_m: the measured width of open fingers; None: the largest width measured so far.
        cameras: take the pictures of `observe`.

    Raises:
        InvalidInputError: for a bound of forces if the driver reports no forces.

    Attributes:
        to_find: names of objects that the service shall find in the pictures, as in `Observation`.
    """

    def __init__(
        self,
        driver: Driver,
        *,
        calibration: Calibration | None = None,
        observe_scene: Callable[[], Observation] | None = None,
        limits: MotionLimits = NO_BOXES,
        tolerance: Tolerance = TOLERANCE,
        open_width_m: float | None = None,
        cameras: Rig | None = None,
    ) -> None:
        self.driver, self.cameras = driver, cameras or Rig()
        self.to_find: tuple[str, ...] = ()
        self.calibration = calibration or Calibration.none()
        self._limits, self._tolerance, self._interlock = limits, tolerance, Interlock(driver)
        self._observe_scene = observe_scene or Observation
        self._open_width_m = open_width_m
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
        """Stop the arm, and disconnect from it and its cameras."""
        self.stop()
        try:
            self.driver.close()
        finally:
            self.cameras.close()

    def hand_to_world(self) -> Array:
        """Return the hand's present pose (4, 4) in the world frame."""
        return self.state().matrix()

    def state(self) -> ArmState:
        """Return the arm's present state in the world frame; safe to call from another thread."""
        return self.calibration.state_to_world(self.driver.state())

    def frames(self) -> tuple[RgbdFrame, ...]:
        """Return what the cameras see now; raises as `Rig.frames`."""
        return self.cameras.frames(self.hand_to_world)

    def observe(self) -> Observation:
        """Return the scene as it is now; raises as `frames`."""
        frames = self.frames()
        if self.cameras.table is not None:
            self.cameras.table.check(frames)
        seen = self._observe_scene()
        known = {item.name for item in seen.objects}
        to_find = dict.fromkeys((*seen.to_find, *(name for name in self.to_find if name not in known)))
        return Observation(seen.objects, (*seen.frames, *frames), to_find, self.state().pose(), seen.mask_ids)

    def preview(self, actions: Sequence[EndEffectorAction], limits: MotionLimits) -> tuple[Previewed, ...]:
        """Return what a plan requires of the arm from its present pose; nothing moves.

        Args:
            limits: of the task; the way is checked against its boxes and the cell's.

        Raises:
            MotionError: if the arm does not answer.
        """
        state = self.state()
        boxes = (*self._limits.keep_out, *limits.keep_out)
        return preview_plan(
            actions,
            self.calibration,
            MotionLimits(keep_out=boxes, hand_radius_m=max(self._limits.hand_radius_m, limits.hand_radius_m)),
            geometry=self._geometry(),
            joints_rad=state.joint_positions_rad,
            start_m=state.position_m.tolist(),
        )

    def check_plan(self, actions: Sequence[EndEffectorAction]) -> None:
        """Check a plan against the cell's limits and the arm's reach; nothing moves.

        Raises:
            UnsafeActionError, MotionError: naming the first action that is beyond the limits or cannot be reached.
        """
        guard = MotionGuard(self._limits, len(actions), self.state().pose())
        for action in actions:
            guard.check(action)
        has_geometry = self._geometry() is not None
        for number, item in enumerate(self.preview(actions, NO_BOXES), 1):
            try:
                if item.problem:
                    raise MotionError(item.problem)
                if not has_geometry:
                    self._check_reach(item.action)
            except MotionError as error:
                raise MotionError(f"action {number} of the plan: {error}; nothing was moved") from error

    def _geometry(self) -> Chain | None:
        return self.driver.geometry() if isinstance(self.driver, KnowsItsJoints) else None

    def _check_reach(self, action: EndEffectorAction) -> tuple[Array, Array]:
        """Return the action's pose in the base frame; raises MotionError if it is out of reach."""
        pose = self.calibration.to_base(action.position_m, action.quaternion_xyzw)
        self.driver.check(*pose)
        return pose

    def execute(self, action: EndEffectorAction) -> None:
        """Move to the action's pose, then set the gripper. The arm is stopped before any error is raised.

        Raises:
            UnsafeActionError: if the action is beyond the cell's limits; nothing moved.
            MotionError: before any motion if the pose is out of reach or the arm was stopped; after it if arm or
                gripper did not do as commanded.
        """
        with self._interlock.alone():
            before_m = self._move(action).gripper_width_m
            self.set_gripper(is_open=action.gripper_open)
            width_m = self.driver.state().gripper_width_m
            if width_m is not None and before_m is not None:
                self._open_width_m = max(self._open_width_m or 0.0, width_m, before_m)  # NaN is never the largest
                self._tolerance.check_gripper(width_m, self._open_width_m, is_open=action.gripper_open)

    def go_to(self, pose: Pose) -> None:
        """Move as `execute` does without changing the gripper; raises as `execute`."""
        with self._interlock.alone():
            self._move(_at(pose))

    def problem_with(self, pose: Pose) -> str:
        """Return why the hand cannot go to a pose; empty if no reason is known."""
        there = _at(pose)
        try:
            MotionGuard(self._limits, before=self.state().pose()).check(there)
            self._check_reach(there)
        except UnsafeActionError as error:
            return error.without_action()
        except MotionError as error:
            return str(error)
        return self.preview([there], NO_BOXES)[0].problem

    @contextmanager
    def guided(self) -> Iterator[None]:
        """Let a person move the arm by hand within the context; it holds still afterwards.

        Raises:
            InvalidInputError: if the driver does not support it.
            MotionError: if the arm is moving, was stopped, or refuses; it is stopped then.
        """
        if not isinstance(self.driver, Guidable):
            raise InvalidInputError("guide", f"{self.driver.name} cannot be guided by its driver", "its maker's button")
        with self._interlock.alone(), ExitStack() as guided:
            self._interlock.begin(partial(guided.enter_context, self.driver.guided()))
            yield
            self._interlock.refuse_if_stopped()

    def set_gripper(self, *, is_open: bool) -> None:
        """Open or close the gripper where the arm is, also while it is guided; raises MotionError after a stop."""
        self._interlock.begin(partial(self.driver.set_gripper, is_open=is_open))

    def stop(self) -> None:
        """Stop, from any thread: a motion under way raises MotionError, and nothing moves until `recover`."""
        self._interlock.stop()

    def recover(self) -> None:
        """Let the arm move again after a person has looked; also acknowledge the arm's own errors."""
        self._interlock.recover()

    def _move(self, action: EndEffectorAction) -> ArmState:
        """Move to the action's pose; return the arm's state before the motion."""
        self._interlock.refuse_if_stopped()
        before = self.state()
        MotionGuard(self._limits, before=before.pose()).check(action)
        self._interlock.begin(partial(self.driver.start, *self._check_reach(action)))
        self._interlock.wait(self._tolerance.motion_s, partial(self._tolerance.check_contact, self.state))
        self._tolerance.check_pose(self.state(), action)
        return before


def _at(pose: Pose) -> EndEffectorAction:
    return EndEffectorAction(np.array(pose.position_m), np.array(pose.quaternion_xyzw), gripper_open=True)
