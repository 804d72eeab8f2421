"""The protocol of representations: text for observations and actions, a grammar for replies, and the way back."""

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Protocol

from app.pipeline.episode import Demonstration, Query
from app.pipeline.order.order import Order
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import EndEffectorAction

PROMPT_FORMATS = ("paper", "authors")  # RoboPrompt's: every representation has them
SUMS_FORMAT = "sums"  # of absolute rows only, for small models
REPRESENTATIONS = ("absolute", "object_frame", "action_tokens", "parts")

# The actions of the rows of one reply from index `first` (from 0) on; raises ReplyParseError for one that is not valid.
Decoder = Callable[[int, Sequence[str]], list[EndEffectorAction]]


class Codec(Protocol):
    """A representation fitted to the demonstrations of one prompt.

    Attributes:
        stop: strings that end a reply.
        separator: what stands between a demonstration's actions and the next observation.
        joint: what stands between an observation and its actions.
    """

    stop: ClassVar[tuple[str, ...]]
    separator: ClassVar[str]
    joint: ClassVar[str] = ""

    def needed(self) -> tuple[Demonstration, ...]:
        """The demonstrations that a prompt needs, in their order: some leave out those that repeat others."""
        ...

    def questions(self, order: Order) -> tuple[str, ...]:
        """The instructions to ask for one after the other so that the whole order is carried out."""
        return (order.text,)

    def observation_text(self, query: Query) -> str:
        """The observation as the prompt shows it, including the mark that asks for actions."""
        ...

    def actions_text(self, demonstration: Demonstration) -> str:
        """The demonstration's actions as the prompt shows them, without the separator."""
        ...

    def demonstration_text(self, demonstration: Demonstration) -> str:
        """Observation, actions and separator: what the prompt repeats."""
        return f"{self.observation_text(demonstration)}{self.joint}{self.actions_text(demonstration)}{self.separator}"

    def grammar(self, query: Query, max_actions: int) -> str:
        """The GBNF grammar of valid replies."""
        ...

    def schema(self, query: Query, max_actions: int) -> Mapping[str, object] | None:
        """The JSON Schema of valid replies; None where they are not JSON."""
        return None

    def rows(self, reply_text: str, complete: bool) -> list[str]:
        """The rows that the reply holds so far; with `complete` the whole reply is checked.

        Raises:
            ReplyParseError: if it is not a list of rows.
        """
        ...

    def reply_text(self, rows: Sequence[str]) -> str:
        """The reply that consists of these rows, as demonstrations show it after the observation."""
        ...

    def decoder(self, query: Query) -> Decoder:
        """A function that reads rows of a reply to the query, many at once: numpy takes as long for one as for ten."""
        ...


def row_count_bounds(demonstrations: Sequence[Demonstration], order: Order, max_actions: int) -> tuple[int, int]:
    """The fewest and most rows of a reply: those of a clause in the demonstrations, times the clauses asked for."""
    asked = len(order.clauses)
    counts = [(asked * len(d.actions), len(d.order.clauses)) for d in demonstrations]
    fewest, most = min(rows // shown for rows, shown in counts), max(-(-rows // shown) for rows, shown in counts)
    return min(max(fewest, 1), max_actions), min(most, max_actions)


def clause_by_clause(demonstrations: Sequence[Demonstration], order: Order) -> tuple[str, ...]:
    """The clauses of an order one by one if every demonstration has a single clause: small models do not compose."""
    single = all(len(d.order.clauses) == 1 for d in demonstrations)
    return tuple(clause.text for clause in order.clauses) if single else (order.text,)


def formats_of(representation: str) -> tuple[str, ...]:
    """The prompt formats that a representation has."""
    return (*PROMPT_FORMATS, SUMS_FORMAT) if representation == "absolute" else PROMPT_FORMATS


def usual_format(representation: str, preferred: str) -> str:
    """The format that is preferred where the representation has it, else the paper's."""
    return preferred if preferred in formats_of(representation) else "paper"


def check_style(representation: str, prompt_format: str) -> None:
    """Check that there is such a representation, and that it has the prompt format.

    Raises:
        InvalidInputError: for an unknown name, or a format that the representation does not have.
    """
    if representation not in REPRESENTATIONS:
        raise InvalidInputError("representation", f"is {representation!r}", ", ".join(REPRESENTATIONS))
    if prompt_format not in (formats := formats_of(representation)):
        message = f"is {prompt_format!r} with the representation {representation!r}"
        raise InvalidInputError("prompt_format", message, f"{', '.join(formats)}; {SUMS_FORMAT} with absolute")
