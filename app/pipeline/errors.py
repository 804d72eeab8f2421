"""The errors of the method, in one tree.

    RoboPromptError                in roboprompt_client.errors, as InvalidInputError and UnsafeActionError are
    ├── InvalidInputError          a value that the caller sent is not acceptable; names field and remedy
    │   ├── ObjectSetError         the objects differ from the task's
    │   ├── NoPoseError            the images do not give an object's pose; carries its name
    │   │   ├── ObjectNotVisibleError  no camera sees it
    │   │   └── UncertainPoseError     it is seen, but not well enough
    │   └── InstructionError       an instruction is not clear
    │       ├── UngroundedInstructionError  a phrase of it stands for no object, or for several
    │       └── UnfamiliarInstructionError  it is unlike every taught one
    ├── ReplyParseError            the LLM's reply is not a list of valid actions; carries the raw text
    ├── UnsafeActionError          an action is valid but beyond a bound of motion; names action, value and bound
    └── UnsupportedActionError     an action is valid but unlike what was demonstrated; names what was expected

Other packages (llm, store, services) add branches of their own under RoboPromptError; `app.api.problems` maps each to a
status once.
"""

from roboprompt_client.errors import InvalidInputError, RoboPromptError


class ObjectSetError(InvalidInputError):
    """The objects of an episode or observation are not those of the task."""


class SceneOutOfBoundsError(InvalidInputError):
    """A scene in which every demonstrated plan leaves the workspace."""


class NoPoseError(InvalidInputError):
    """An object whose pose the images do not give.

    Args:
        name: of the object.
    """

    def __init__(self, name: str, message: str, valid: str | None = None) -> None:
        super().__init__(f"objects[{name}]", message, valid)
        self.name = name

    def __reduce__(self) -> tuple[type["NoPoseError"], tuple[str, str, str | None]]:
        """See `InvalidInputError`."""
        return type(self), (self.name, self.message, self.valid)


class ObjectNotVisibleError(NoPoseError):
    """An object that no camera sees: it has no pose."""


class UncertainPoseError(NoPoseError):
    """An object whose pose the images do not show: hidden, ambiguous, or seen differently by the cameras."""


class InstructionError(InvalidInputError):
    """An instruction that is not clear."""


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
