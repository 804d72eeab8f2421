"""What can be wrong with a dataset."""

from app.pipeline.errors import RoboPromptError


class DatasetError(RoboPromptError):
    """A dataset as a whole cannot be read or written; the message says what and how to go on."""


class MissingPackageError(DatasetError):
    """A format needs a package that is not installed.

    Args:
        purpose: what it is needed for, e.g. ``"LeRobot datasets"``.
        requirement: what to install.
    """

    def __init__(self, purpose: str, requirement: str) -> None:
        super().__init__(f"{purpose} need a package that is not installed: pip install {requirement}")


class DamagedError(DatasetError):
    """One file of a dataset is damaged or lacks something; the others are fine.

    Args:
        file: which, as the user finds it.
        reason: what is wrong with it.
    """

    def __init__(self, file: object, reason: object) -> None:
        super().__init__(f"{file}: {reason}")
