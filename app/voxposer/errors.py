"""What a baseline after VoxPoser can refuse."""

from roboprompt_client.errors import RoboPromptError


class ProgramRefusedError(RoboPromptError):
    """A program that is not allowed, fails, or asks for nothing that can be planned. It is reported, never repaired."""
