"""An instruction as it was understood, and what its phrases were taken for."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Grounding:
    """What a phrase of an instruction was taken for.

    Attributes:
        by: name, alias, spelling, colour, relation, taught (nothing named it, but what was taught does), or llm.
    """

    phrase: str
    object_name: str
    by: str

    def to_json(self) -> dict[str, str]:
        """As answers carry it."""
        return {"phrase": self.phrase, "object": self.object_name, "by": self.by}

    @classmethod
    def from_json(cls, value: Mapping[str, str]) -> "Grounding":
        """As `to_json` wrote it."""
        return cls(value["phrase"], value["object"], value["by"])


@dataclass(frozen=True)
class Grounded:
    """An instruction as it was understood.

    Attributes:
        instruction: the canonical instruction: objects by their names, in the form of a taught instruction.
        unfamiliar: why it is unlike every taught instruction, where that was allowed.
    """

    instruction: str
    phrases: tuple[Grounding, ...] = ()
    unfamiliar: str | None = None

    def to_json(self) -> dict[str, Any]:
        """As it is stored."""
        phrases = [phrase.to_json() for phrase in self.phrases]
        return {"instruction": self.instruction, "phrases": phrases, "unfamiliar": self.unfamiliar}

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> "Grounded":
        """As `to_json` wrote it."""
        phrases = tuple(map(Grounding.from_json, value["phrases"]))
        return cls(value["instruction"], phrases, value["unfamiliar"])
