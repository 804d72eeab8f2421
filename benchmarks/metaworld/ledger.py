"""Results on disk, a JSON object a line: what is there is not run again."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

REPLAY = "replay"  # the method that executes a demonstration's own keyframes in its own scene


class LedgerError(ValueError):
    """A file of results does not fit this run."""


@dataclass(frozen=True)
class Taught:
    """A task's demonstrations at a service.

    Attributes:
        task: of Meta-World.
        service_task: its name at the service.
        seeds: of the scenes that the stored episodes show, by the episodes' ids.
        keyframes: of each stored episode, how many.
        refused: what the service said of demonstrations that it did not take.
    """

    task: str
    service_task: str
    seeds: dict[str, int]
    keyframes: list[int]
    refused: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Trial:
    """One execution, or one that could not be.

    Attributes:
        method: `REPLAY` or a model's name.
        seed: of the scene.
        success: whether the task was done.
        seconds: of the prediction; nil for a replay.
        steps: that the execution took; 80 a second.
        problem: why nothing was executed; None where something was.
        details: what else the service answered.
    """

    task: str
    method: str
    seed: int
    success: bool
    seconds: float = 0.0
    steps: int = 0
    problem: str | None = None
    details: dict[str, Any] = field(default_factory=dict)


class Ledger:
    """The results in a file. A context manager.

    Args:
        conditions: everything but number of tests, tasks and models that results depend on.

    Raises:
        LedgerError: if the file was written under other conditions, or is not one of ours.
    """

    def __init__(self, path: Path, conditions: Mapping[str, Any]) -> None:
        self._taught: dict[str, Taught] = {}
        self._trials: dict[tuple[str, str, int], Trial] = {}
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        wanted = json.loads(json.dumps(dict(conditions)))  # as it comes back from the file
        known = self._read()
        if known is not None and known != wanted:
            differ = ", ".join(sorted(key for key in {**known, **wanted} if known.get(key) != wanted.get(key)))
            raise LedgerError(f"{path} has results under other conditions ({differ}): name another file with --out")
        self._file = path.open("a")
        if known is None:
            self._append("conditions", wanted)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._file.close()

    def taught(self, task: str) -> Taught | None:
        """How the task was last taught."""
        return self._taught.get(task)

    def trials(self, task: str, method: str) -> list[Trial]:
        """By seed."""
        found = (trial for trial in self._trials.values() if (trial.task, trial.method) == (task, method))
        return sorted(found, key=lambda trial: trial.seed)

    def add(self, result: Taught | Trial) -> None:
        """Keep a result."""
        self._remember(result)
        self._append(type(result).__name__.lower(), asdict(result))

    def _append(self, kind: str, values: Mapping[str, Any]) -> None:
        self._file.write(json.dumps({"kind": kind, **values}) + "\n")
        self._file.flush()

    def _remember(self, result: Taught | Trial) -> None:
        if isinstance(result, Taught):
            self._taught[result.task] = result
        else:
            self._trials[result.task, result.method, result.seed] = result

    def _read(self) -> dict[str, Any] | None:
        """The conditions of the file; None if there are no results yet."""
        text = self.path.read_text() if self.path.exists() else ""
        whole = text[: text.rfind("\n") + 1]
        if whole != text:  # a run was killed while it wrote
            self.path.write_text(whole)
        try:
            first: dict[str, Any] | None
            first, *others = [json.loads(line) for line in whole.splitlines()] or [None]
            for line in others:
                self._remember({"taught": Taught, "trial": Trial}[line.pop("kind")](**line))
            if first is not None and first.pop("kind") != "conditions":
                raise LedgerError("its first line has no conditions")
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise LedgerError(f"{self.path} is no file of this benchmark: {error}") from error
        return first
