"""Stores `results.jsonl`: a JSON document for each trial, on disk as soon as it ends, so that runs can resume."""

import fcntl
import json
import os
import threading
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from app.evaluation.results import Crash, Trial
from app.sim.outcomes import RolloutResult, SceneView
from roboprompt_client.errors import RoboPromptError
from roboprompt_client.types.poses import EndEffectorAction, object_from_json, object_json

Document = Mapping[str, Any]
AS_IT_IS = ("task", "seed", "method", "predict_s", "execute_s", "answer", "shift_m", "refused")  # of a trial

_Key = tuple[str, int, str, str]  # task, seed, method, digest


class LedgerError(RoboPromptError):
    """Another run writes into the file, or one of its lines was not written by a run."""


def document_of(outcome: Trial | Crash) -> Document:
    """Return a trial as JSON, without pictures, which can be made again from its actions."""
    if isinstance(outcome, Crash):
        return {"status": "error", **asdict(outcome)}
    execution = outcome.execution
    return {
        "status": "success" if outcome.succeeded else "failure",
        "failure": outcome.failure,
        "instruction": outcome.scene.instruction,
        "objects": [object_json(pose) for pose in outcome.scene.objects],
        "actions": [_action_json(action) for action in outcome.actions],
        "num_executed": None if execution is None else execution.num_executed,
        **{name: getattr(outcome, name) for name in AS_IT_IS},
    }


def outcome_of(document: Document) -> Trial | Crash:
    """Return the trial of a document; the inverse of `document_of`."""
    task, seed = document["task"], document["seed"]
    if document["status"] == "error":
        return Crash(task, seed, document["method"], document["message"])
    execution, num_executed = None, document["num_executed"]
    if num_executed is not None:
        succeeded = document["status"] == "success"
        execution = RolloutResult(num_executed, succeeded, document["failure"])
    return Trial(
        scene=SceneView(task, seed, document["instruction"], tuple(map(object_from_json, document["objects"])), (), {}),
        error="" if execution else document["failure"],
        execution=execution,
        actions=tuple(action_of(item) for item in document["actions"]),
        **{name: document[name] for name in AS_IT_IS},
    )


def _action_json(action: EndEffectorAction) -> Document:
    return {
        "position": action.position_m.tolist(),
        "quaternion_xyzw": action.quaternion_xyzw.tolist(),
        "gripper_open": action.gripper_open,
    }


def action_of(item: Document) -> EndEffectorAction:
    """Return an action of a JSON document."""
    return EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])


class Ledger:
    """The outcomes in a file. A context manager; thread-safe.

    Raises:
        LedgerError: if another process has it open, or a line is not an outcome.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._file = path.open("a+b")
        try:
            self._outcomes = dict(self._read())
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._file.close()

    def find(self, task: str, seed: int, method: str, digest: str) -> Trial | Crash | None:
        """Return the last outcome of a trial; None without one."""
        return self._outcomes.get((task, seed, method, digest))

    def append(self, outcome: Trial | Crash, digest: str) -> None:
        """Write an outcome to disk."""
        document = {**document_of(outcome), "digest": digest, "at": datetime.now(UTC).isoformat(timespec="seconds")}
        line = json.dumps(document, allow_nan=False).encode() + b"\n"
        with self._lock:
            self._file.write(line)
            self._file.flush()
            os.fsync(self._file.fileno())
            self._outcomes[_key(document)] = outcome

    def _read(self) -> list[tuple[_Key, Trial | Crash]]:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LedgerError(f"another run writes into {self._file.name}") from None
        self._file.seek(0)
        *lines, torn = self._file.read().split(b"\n")
        if torn:  # a run was killed while it wrote
            self._file.truncate(self._file.tell() - len(torn))
        return [self._parse(number, line) for number, line in enumerate(lines, start=1)]

    def _parse(self, number: int, line: bytes) -> tuple[_Key, Trial | Crash]:
        try:
            document = json.loads(line)
            return _key(document), outcome_of(document)
        except (ValueError, KeyError, TypeError) as error:
            raise LedgerError(f"{self._file.name}, line {number}, is no trial: {error!r}") from error


def _key(document: Mapping[str, Any]) -> _Key:
    return document["task"], document["seed"], document["method"], document["digest"]
