"""A motion in small steps, for arms whose controller follows each target at once."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator

from roboprompt_client.arms.driver import STEERED_S, ArmState, straight_way
from roboprompt_client.types.arrays import Array


class Stepping(ABC):
    """The part of a `Driver` that starts, steers and halts such an arm. After a halt no step follows.

    Args:
        step_m, step_rad: the largest step.
    """

    def __init__(self, step_m: float, step_rad: float) -> None:
        self._step = step_m, step_rad
        self._steps: Iterator[tuple[Array, Array]] = iter(())
        self._sending = threading.Lock()  # so that no step follows a halt of another thread

    @abstractmethod
    def state(self) -> ArmState:
        """As `Driver.state`."""

    @abstractmethod
    def send(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Command a target pose (3,), (4,) in the base frame."""

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._steps = straight_way(self.state(), position_m, quaternion_xyzw, *self._step)

    def send_next(self) -> bool:
        """Send the next step; return whether there was one."""
        with self._sending:
            step = next(self._steps, None)
            if step is not None:
                self.send(*step)
        return step is not None

    def steer(self, velocity_m_s: Array, turning_rad_s: Array) -> None:
        """Send a pose a little ahead, at which the arm rests unless another one follows."""
        ahead = self.state().moved(velocity_m_s, turning_rad_s, STEERED_S)
        with self._sending:
            self._steps = iter(())
            self.send(*ahead)

    def halt(self) -> None:
        """Command the present pose; if it is not known, at least no further step is sent."""
        with self._sending:
            self._steps = iter(())
            now = self.state()
            self.send(now.position_m, now.quaternion_xyzw)
