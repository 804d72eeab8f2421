"""Which models requests may ask, as far as the operator sets it (docs/settings.md)."""

from dataclasses import dataclass
from fnmatch import fnmatchcase

from roboprompt_client.errors import InvalidInputError


@dataclass(frozen=True)
class OfferedModels:
    """Rules for the names of models in requests; the default model is always offered.

    Attributes:
        allowed: patterns of names; none: any.
        files: whether an embedded model may be named by the path of its file.
    """

    allowed: tuple[str, ...] = ()
    files: bool = True

    def check(self, name: str) -> None:
        """Refuse models that the operator does not want to be used, and files of this machine."""
        if self.allowed and not any(fnmatchcase(name, pattern) for pattern in self.allowed):
            raise InvalidInputError("model", f"is {name!r}, which is not offered here", ", ".join(self.allowed))
        model = name.partition("embedded/")[2]
        if not self.files and ("/" in model or model.endswith(".gguf")):
            raise InvalidInputError("model", f"is {name!r}, a file of the service's machine", "a name from GET /models")
