"""The part of a prompt that does not depend on the query, made once per task version and format."""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.pipeline.episode import Demonstration
from app.pipeline.prompt import PromptTemplate, system_prompt_text
from app.pipeline.representation import fit_codec
from app.services.task_settings import TaskSettings

CAPACITY = 256


@dataclass(frozen=True)
class PromptStyle:
    """How a prompt is written.

    Attributes:
        system_prompt: a variant's name or free text.
    """

    representation: str
    prompt_format: str
    system_prompt: str


@dataclass(frozen=True)
class TemplateKey:
    """What a template depends on: nothing else may change its bytes.

    Attributes:
        demonstrations: how they were selected, or their ids.
    """

    task: str
    version: int
    style: PromptStyle
    demonstrations: tuple[str | int, ...]


@dataclass(frozen=True, eq=False)
class Template:
    """A prompt template with what it was made of.

    Attributes:
        cache_key: equal for equal prefixes.
    """

    prompt: PromptTemplate
    demonstration_ids: tuple[str, ...]
    cache_key: str


class TemplateCache:
    """The most recently used templates. Safe for concurrent use."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._templates: OrderedDict[TemplateKey, Template] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: TemplateKey, make: Callable[[], Template]) -> Template:
        """The template of that key, made if it is not there."""
        with self._lock:
            if (found := self._templates.get(key)) is not None:
                self._templates.move_to_end(key)
                return found
        template = make()
        with self._lock:
            self._templates[key] = template
            while len(self._templates) > self._capacity:
                self._templates.popitem(last=False)
        return template


def make_template(demonstrations: Sequence[Demonstration], settings: TaskSettings, style: PromptStyle) -> Template:
    """Fit the representation and write the demonstrations.

    Raises:
        InvalidInputError: without demonstrations.
    """
    canonical = tuple(
        Demonstration(d.instruction, settings.canonical(d.objects), d.actions, d.id) for d in demonstrations
    )
    codec = fit_codec(style.representation, style.prompt_format, canonical, settings.workspace.workspace())
    prompt = PromptTemplate.write(codec, canonical, system_prompt_text(style.system_prompt))
    digest = hashlib.sha256(f"{prompt.system}\0{prompt.prefix}".encode()).hexdigest()[:16]
    return Template(prompt, tuple(d.id for d in demonstrations), digest)
