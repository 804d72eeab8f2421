"""What every representation offers: text for observations and actions, a grammar for replies, and the way back."""

from collections.abc import Sequence
from typing import Protocol

from app.pipeline.episode import Demonstration, EndEffectorAction, ObjectPose


class Codec(Protocol):
    """A representation fitted to the demonstrations of one prompt.

    Attributes:
        stop: strings that end a reply.
    """

    @property
    def stop(self) -> tuple[str, ...]: ...

    def observation_text(self, objects: Sequence[ObjectPose], instruction: str) -> str:
        """The observation as the prompt shows it, including the mark that asks for actions."""
        ...

    def actions_text(self, demonstration: Demonstration) -> str:
        """The demonstration's actions as the prompt shows them, without the separator."""
        ...

    def demonstration_text(self, demonstration: Demonstration) -> str:
        """Observation, actions and separator: what the prompt repeats."""
        ...

    def grammar(self, instruction: str, max_actions: int) -> str:
        """The GBNF grammar of valid replies."""
        ...

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        """The rows that the reply holds so far; with `complete` the whole reply is checked.

        Raises:
            ReplyParseError: if it is not a list of rows.
        """
        ...

    def decode_row(self, index: int, row: str, objects: Sequence[ObjectPose]) -> EndEffectorAction:
        """The action of the row at `index` (from 0), given the observed objects.

        Raises:
            ReplyParseError: if it is not a valid row.
        """
        ...


def row_count_bounds(demonstrations: Sequence[Demonstration], num_clauses: int, max_actions: int) -> tuple[int, int]:
    """The fewest and most rows a reply may have: those seen in the demonstrations, times the instruction's clauses."""
    counts = [len(demonstration.actions) for demonstration in demonstrations]
    fewest, most = min(counts) * num_clauses, max(counts) * num_clauses
    return min(fewest, max_actions), min(most, max_actions)
