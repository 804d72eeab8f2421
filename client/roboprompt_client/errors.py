"""The errors of this package; the server derives its own from RoboPromptError, too."""

from collections.abc import Mapping
from typing import Any


class RoboPromptError(Exception):
    """Base of every error that this project raises on purpose."""


class InvalidInputError(RoboPromptError, ValueError):
    """A value that is not allowed.

    Args:
        field: path of the value in the caller's terms, e.g. ``trajectory.joint_velocities``.
        message: what is wrong, with the value.
        valid: what would be accepted.
    """

    def __init__(self, field: str, message: str, valid: str | None = None) -> None:
        super().__init__(f"{field}: {message}" + (f" (valid: {valid})" if valid else ""))
        self.field, self.message, self.valid = field, message, valid

    def __reduce__(self) -> tuple[type["InvalidInputError"], tuple[str, str, str | None]]:
        """Keep the arguments when the error is pickled; by default only its text is kept."""
        return type(self), (self.field, self.message, self.valid)


class UnsafeActionError(RoboPromptError):
    """An action that no robot may carry out.

    Args:
        index: of the action, from 0.
        quantity: the member that is wrong, e.g. ``position.z``.
        message: what is wrong, with the value.
        bound: what would be allowed.
    """

    def __init__(self, index: int, quantity: str, message: str, bound: str) -> None:
        super().__init__(f"action {index}: {quantity} {message} (allowed: {bound})")
        self.field = f"actions[{index}].{quantity}"
        self._quantity, self.message, self.bound = quantity, message, bound

    def without_action(self) -> str:
        """Return the text for a pose that belongs to no plan."""
        return f"{self._quantity} {self.message} (allowed: {self.bound})"


class ServiceProblemError(RoboPromptError):
    """The service refused a request or failed.

    Attributes:
        status: the HTTP status.
        problem: the `application/problem+json` document: type, title, detail, errors; for an unparsable reply also
            `reply_text`.
    """

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        super().__init__(f"{status} {problem.get('title', '')}: {problem.get('detail', '')}")
        self.status, self.problem = status, problem

    def __reduce__(self) -> tuple[type["ServiceProblemError"], tuple[int, Mapping[str, Any]]]:
        return type(self), (self.status, self.problem)


class ServiceUnreachableError(RoboPromptError):
    """The service did not answer: a wrong address, not started, stopped, or too slow (`timed_out`)."""

    def __init__(self, message: str, *, timed_out: bool = False) -> None:
        super().__init__(message)
        self.timed_out = timed_out


class InvalidAnswerError(RoboPromptError):
    """The service's answer breaks its own contract, so none of it can be trusted."""

    def __init__(self, field: str, message: str, valid: str) -> None:
        super().__init__(f"the service's answer: {field} {message} (valid: {valid})")
        self.field = field


class ObjectLostError(RoboPromptError):
    """`object_name`, which an action refers to, cannot be seen any more; the robot was stopped."""

    def __init__(self, object_name: str, reason: str) -> None:
        super().__init__(f"{object_name!r} is lost: {reason}")
        self.object_name = object_name


class CameraError(RoboPromptError):
    """A camera gave no usable picture; `remedy` would help. A driver does not know the `camera`'s name."""

    def __init__(self, message: str, remedy: str, camera: str = "") -> None:
        super().__init__(f"camera {camera!r}: {message} (needed: {remedy})" if camera else f"{message} ({remedy})")
        self.message, self.remedy, self.camera = message, remedy, camera

    def of(self, camera: str) -> "CameraError":
        """Return the same error with the camera's name."""
        return CameraError(self.message, self.remedy, camera)


class DangerError(RoboPromptError):
    """The prediction has a finding of severity `danger`, and no person allowed it; nothing was moved."""


class StepFailedError(RoboPromptError):
    """A step of a plan failed, or its outcome is not known; the later steps were not begun."""


class MotionError(RoboPromptError):
    """The robot could not carry out an action."""


class NotConfirmedError(RoboPromptError):
    """A person did not allow an action."""
