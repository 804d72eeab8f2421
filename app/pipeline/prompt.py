"""Demonstrations, observation and instruction -> the prompt (paper, section III-D, appendix B)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Demonstration, Query, rotation_of
from app.pipeline.representation.base import Codec
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose

# The paper's system prompt (a) and its paraphrases (b) and (c), appendix B; "none" for models that only
# continue text.
SYSTEM_PROMPTS = {
    "a": (
        "You are a Franka Panda robot with a parallel gripper. We provide you with some demos in the format of "
        "observation>[action_1, action_2, ...]. Then you will receive a new observation and you need to output a "
        "sequence of actions that match the trends in the demos. Do not output anything else."
    ),
    "b": (
        "You are an end-effector Franka Panda robot equipped with a parallel gripper. We will give you a series of "
        "demonstrations in the format observation>[action_1, action_2, ...]. Afterward, you will receive a new "
        "observation, and your task is to generate a sequence of actions that align with the patterns shown in the "
        "demos. Make sure to only output the actions and nothing else."
    ),
    "c": (
        "You are a Franka Panda robot equipped with a parallel gripper. We will provide you with demonstrations in "
        "the format: observation>[action_1, action_2, ...]. Afterward, you will receive a new observation and must "
        "generate a sequence of actions that align with the patterns shown in the demos. Ensure that nothing else is "
        "included in your output."
    ),
    "none": "",
}
MAX_SYSTEM_PROMPT_CHARS = 4000


@dataclass(frozen=True)
class Prompt:
    """What an LLM is asked to continue.

    Attributes:
        system: the system prompt; empty for none.
        prefix: the demonstrations; byte-identical for every query of the same task version and format.
        query: the new observation; `prefix + query` is the user message.
        stop: strings that end the reply (not part of it).
        grammar: GBNF of valid replies for backends that can force one, or None.
        schema: JSON Schema of valid replies for backends that can force one, or None.
    """

    system: str
    prefix: str
    query: str
    stop: tuple[str, ...] = ()
    grammar: str | None = None
    schema: Mapping[str, object] | None = None

    @property
    def user(self) -> str:
        """The user message: the demonstrations, then the query."""
        return self.prefix + self.query


@dataclass(frozen=True, eq=False)
class PromptTemplate:
    """The part of a prompt that does not depend on the query; written once per task version and format.

    Attributes:
        codec: fitted to the demonstrations; also reads replies.
        rotated: objects whose rotation every demonstration has.
    """

    codec: Codec
    system: str
    prefix: str
    rotated: frozenset[str]

    @classmethod
    def write(cls, codec: Codec, demonstrations: Sequence[Demonstration], system: str) -> "PromptTemplate":
        """Return the template of the demonstrations that the codec needs, as observation, actions and separator."""
        needed = codec.needed()
        prefix = "".join(codec.demonstration_text(item) for item in demonstrations if item in needed)
        known = [{pose.name for pose in item.objects if pose.quaternion_xyzw is not None} for item in demonstrations]
        return cls(codec, system, prefix, frozenset(set.intersection(*known)))

    def posed(self, objects: Sequence[ObjectPose]) -> tuple[ObjectPose, ...]:
        """Return the observed objects with rotations only where all demonstrations have them, so that both read alike.

        Raises:
            InvalidInputError: if an object lacks a rotation that every demonstration has.
        """
        for pose in objects:
            if pose.name in self.rotated:
                rotation_of(pose)
        return tuple(pose if pose.name in self.rotated else replace(pose, quaternion_xyzw=None) for pose in objects)

    def ask(self, query: Query, max_actions: int, so_far: str = "") -> Prompt:
        """Return the prompt that asks for a query's actions.

        Args:
            so_far: the queries before it and their replies, where an instruction is asked for clause by clause.
        """
        text = so_far + self.codec.observation_text(query)
        grammar, schema = self.codec.grammar(query, max_actions), self.codec.schema(query, max_actions)
        return Prompt(self.system, self.prefix, text, self.codec.stop, grammar, schema)


def system_prompt_text(choice: str) -> str:
    """Return the text of a system prompt (`a`, `b`, `c`, `none`), or `choice` itself where it is free text.

    Raises:
        InvalidInputError: if the text is longer than 4000 characters.
    """
    if len(choice) > MAX_SYSTEM_PROMPT_CHARS:
        valid = f"at most {MAX_SYSTEM_PROMPT_CHARS} characters, or one of {', '.join(SYSTEM_PROMPTS)}"
        raise InvalidInputError("system_prompt", f"has {len(choice)} characters", valid)
    return SYSTEM_PROMPTS.get(choice, choice)
