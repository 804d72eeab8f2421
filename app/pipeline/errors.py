"""Everything that the method can refuse.

    RoboPromptError
    ├── InvalidInputError          a value that the caller sent is not acceptable; names field and remedy
    │   ├── ObjectSetError         the objects differ from the task's
    │   ├── ObjectNotVisibleError  no camera sees an object
    │   ├── UncertainPoseError     an object is seen, but not well enough to tell its pose
    │   └── InstructionError       an instruction is not clear; lists those that the task knows
    │       ├── UngroundedInstructionError  a phrase of it stands for no object, or for several
    │       └── UnfamiliarInstructionError  it is unlike every taught one
    ├── ReplyParseError            the LLM's reply is not a list of valid actions; carries the raw text
    ├── UnsafeActionError          an action is valid but beyond a bound of motion; names action, value and bound
    └── UnsupportedActionError     an action is valid but unlike what was demonstrated; names what was expected

Other packages (llm, store, services) hang their own branches under RoboPromptError; `app.api.problems` maps each to a
status once.
"""


class RoboPromptError(Exception):
    """Base of every error that this project raises on purpose."""


class InvalidInputError(RoboPromptError, ValueError):
    """A value that does not satisfy the method's requirements.

    Args:
        field: path of the value as the caller knows it, e.g. ``trajectory.joint_velocities``.
        message: what is wrong, with the offending value.
        valid: what would be accepted.
    """

    def __init__(self, field: str, message: str, valid: str | None = None) -> None:
        super().__init__(f"{field}: {message}" + (f" (valid: {valid})" if valid else ""))
        self.field = field
        self.message = message
        self.valid = valid

    def __reduce__(self) -> tuple[type["InvalidInputError"], tuple[str, str, str | None]]:
        """Exceptions are rebuilt from their text only, which processes that raise them for others cannot use."""
        return type(self), (self.field, self.message, self.valid)


class ObjectSetError(InvalidInputError):
    """The objects of an episode or observation are not those of the task."""


class ObjectNotVisibleError(InvalidInputError):
    """An object that no camera sees: it has no pose."""


class UncertainPoseError(InvalidInputError):
    """An object whose pose the images do not show: hidden, ambiguous, or seen differently by the cameras."""


class InstructionError(InvalidInputError):
    """An instruction that is not clear.

    Attributes:
        choices: the instructions that the task knows, among which it may be.
    """

    choices: tuple[str, ...] = ()


class UngroundedInstructionError(InstructionError):
    """An instruction of which a phrase stands for no object of the task, or for several."""


class UnfamiliarInstructionError(InstructionError):
    """An instruction that is unlike every taught one, or has words that nothing explains."""


class ReplyParseError(RoboPromptError):
    """A reply that is not a list of valid actions. It is reported, never repaired.

    Args:
        message: what is wrong with the reply.
        reply_text: the reply as the LLM gave it.
    """

    def __init__(self, message: str, reply_text: str) -> None:
        super().__init__(message)
        self.message = message
        self.reply_text = reply_text


class UnsafeActionError(RoboPromptError):
    """An action that no robot may carry out. It is reported, never clipped.

    Args:
        index: of the action, from 0.
        quantity: which of its members, e.g. ``position.z``.
        message: what is wrong with it, with the value.
        bound: what would be allowed.
    """

    def __init__(self, index: int, quantity: str, message: str, bound: str) -> None:
        super().__init__(f"action {index}: {quantity} {message} (allowed: {bound})")
        self.field = f"actions[{index}].{quantity}"
        self.message = message
        self.bound = bound


class UnsupportedActionError(RoboPromptError):
    """An action that the demonstrations do not support. It is reported, never moved to where they have it.

    Args:
        index: of the action, from 0.
        message: what is wrong with it.
        expected: what the demonstrations have there.
    """

    def __init__(self, index: int, message: str, expected: str) -> None:
        super().__init__(f"actions[{index}] {message} (expected: {expected})")
        self.field = f"actions[{index}]"
        self.message = message
        self.expected = expected
