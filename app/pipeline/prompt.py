"""Demonstrations + observation + instruction -> the text that the LLM continues (paper, section III-D, appendix B)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from app.pipeline.episode import Demonstration
from app.pipeline.errors import ObjectSetError
from app.pipeline.representation.base import Codec
from app.pipeline.representation.other_tasks import OtherTasksCodec
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose

# The paper's system prompt (a) and its paraphrases (b) and (c), appendix B; one in the manner of KAT (arXiv 2403.19578)
# that says the same as its authors' in other words; "none" for models that only continue text.
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
    "kat": (
        "You are a machine that continues patterns. I show you a number of patterns as examples, each with its INPUTS "
        "and its OUTPUTS. After them I give you new INPUTS, and you generate the OUTPUTS that follow the same pattern "
        "as the data. All points are (x, y, z) coordinates. Reply with the numbers of the OUTPUTS only."
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
    """All of a prompt that does not depend on the query; made once per task version and format.

    Attributes:
        codec: fitted to the demonstrations; reads the replies as well.
        rotated: objects whose rotation every demonstration has.
        of_other_tasks: whether the demonstrations are of other tasks, and have other objects (`in_scene`).
    """

    codec: Codec
    system: str
    prefix: str
    rotated: frozenset[str]
    of_other_tasks: bool = False

    @classmethod
    def write(
        cls,
        codec: Codec,
        demonstrations: Sequence[Demonstration],
        system: str,
        written: Sequence[Demonstration] | None = None,
    ) -> "PromptTemplate":
        """The demonstrations in their order, each as observation, actions and separator.

        Args:
            written: those of them that the text shows; None: all.
        """
        known = [{pose.name for pose in d.objects if pose.quaternion_xyzw is not None} for d in demonstrations]
        prefix = "".join(codec.demonstration_text(d) for d in (demonstrations if written is None else written))
        return cls(codec, system, prefix, frozenset(set.intersection(*known)))

    @classmethod
    def write_other_tasks(cls, codec: Codec, demonstrations: Sequence[Demonstration], system: str) -> "PromptTemplate":
        """The demonstrations of other tasks in their order; a codec that knows leaves out those that repeat others."""
        needed = codec.telling() if isinstance(codec, OtherTasksCodec) else demonstrations
        written = [item for item in demonstrations if any(item is one for one in needed)]
        prefix = "".join(map(codec.demonstration_text, written))
        return cls(codec, system, prefix, frozenset(), of_other_tasks=True)

    def in_scene(self, objects: Sequence[ObjectPose]) -> "PromptTemplate":
        """The template to ask about these objects, which the demonstrations of other tasks do not have."""
        if not self.of_other_tasks:
            return self
        codec = self.codec.in_scene(objects) if isinstance(self.codec, OtherTasksCodec) else self.codec
        rotated = frozenset(pose.name for pose in objects if pose.quaternion_xyzw is not None)
        return replace(self, codec=codec, rotated=rotated)

    def posed(self, objects: Sequence[ObjectPose]) -> tuple[ObjectPose, ...]:
        """The observed objects with rotations just where the demonstrations have them, so that both read alike.

        Raises:
            InvalidInputError: if an object lacks a rotation that every demonstration has.
        """
        for pose in objects:
            if pose.quaternion_xyzw is None and pose.name in self.rotated:
                message = "is missing, but every demonstration has it"
                field = f"objects[{pose.name}].quaternion_xyzw"
                raise InvalidInputError(field, message, "a unit quaternion, order x y z w")
        return tuple(pose if pose.name in self.rotated else replace(pose, quaternion_xyzw=None) for pose in objects)

    def ask(self, objects: Sequence[ObjectPose], instruction: str, max_actions: int, so_far: str = "") -> Prompt:
        """The prompt that asks for the actions of a new observation.

        Args:
            so_far: the steps of a closed loop that were taken already.
        """
        query = so_far + self.codec.observation_text(objects, instruction)
        grammar = self.codec.grammar(instruction, max_actions)
        schema = self.codec.schema(instruction, max_actions)
        return Prompt(self.system, self.prefix, query, self.codec.stop, grammar, schema)


def system_prompt_text(choice: str) -> str:
    """The text of a named system prompt (`a`, `b`, `c`, `kat`, `none`), or `choice` itself where it is free text.

    Raises:
        InvalidInputError: if the text is longer than 4000 characters.
    """
    if len(choice) > MAX_SYSTEM_PROMPT_CHARS:
        valid = f"at most {MAX_SYSTEM_PROMPT_CHARS} characters, or one of {', '.join(SYSTEM_PROMPTS)}"
        raise InvalidInputError("system_prompt", f"has {len(choice)} characters", valid)
    return SYSTEM_PROMPTS.get(choice, choice)


def objects_of_task(objects: Sequence[ObjectPose], names: Sequence[str]) -> tuple[ObjectPose, ...]:
    """The observed objects in the task's order.

    Raises:
        ObjectSetError: if the names differ from the task's, or one appears twice; names the difference.
    """
    check_object_names([pose.name for pose in objects], names)
    by_name = {pose.name: pose for pose in objects}
    return tuple(by_name[name] for name in names)


def check_object_names(given: Sequence[str], names: Sequence[str]) -> None:
    """Refuse object names that are not those of the task.

    Raises:
        ObjectSetError: names what is missing, unknown or given twice.
    """
    missing = [name for name in names if name not in given]
    unknown = [name for name in dict.fromkeys(given) if name not in names]
    twice = sorted({name for name in given if list(given).count(name) > 1})
    differences = {"missing": missing, "not of this task": unknown, "given twice": twice}
    if said := "; ".join(f"{what}: {', '.join(which)}" for what, which in differences.items() if which):
        raise ObjectSetError("objects", said, ", ".join(names))
