"""Which prompt formats each representation has, by name."""

from roboprompt_client.errors import InvalidInputError

PROMPT_FORMATS = ("paper", "authors")  # RoboPrompt's: every representation has them
KAT_FORMAT = "kat"  # KAT's own, of its action tokens only
SUMS_FORMAT = "sums"  # of absolute rows only, for small models
REPRESENTATIONS = ("absolute", "object_frame", "action_tokens", "parts")


def formats_of(representation: str) -> tuple[str, ...]:
    """The prompt formats that a representation has."""
    own = {"absolute": (SUMS_FORMAT,), "action_tokens": (KAT_FORMAT,)}
    return (*PROMPT_FORMATS, *own.get(representation, ()))


def usual_format(representation: str, preferred: str) -> str:
    """The format that is preferred where the representation has it, else the paper's."""
    return preferred if preferred in formats_of(representation) else "paper"


def check_style(representation: str, prompt_format: str) -> None:
    """Refuse what cannot be written.

    Raises:
        InvalidInputError: for an unknown name, or a format that the representation does not have.
    """
    if representation not in REPRESENTATIONS:
        raise InvalidInputError("representation", f"is {representation!r}", ", ".join(REPRESENTATIONS))
    if prompt_format not in (formats := formats_of(representation)):
        message = f"is {prompt_format!r} with the representation {representation!r}"
        others = f"{KAT_FORMAT} with the representation action_tokens; {SUMS_FORMAT} with absolute"
        raise InvalidInputError("prompt_format", message, f"{', '.join(formats)}; {others}")
