"""The service, over HTTP."""

import io
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import httpx
import numpy as np

from benchmarks.metaworld.tasks import Floats

PREDICT_TIMEOUT_S = 120.0
HTTP_TIMEOUT_S = 180.0


class ServiceError(RuntimeError):
    """The service does not do what the benchmark cannot go on without."""


@dataclass(frozen=True)
class Answer:
    """Of one request.

    Attributes:
        status: of HTTP.
        document: the body.
        seconds: as the client sees it.
    """

    status: int
    document: dict[str, Any]
    seconds: float

    @property
    def problem(self) -> str | None:
        """What the service says is wrong; None where nothing is."""
        if self.status < 400:
            return None
        said = [str(self.document[key]) for key in ("title", "detail") if self.document.get(key)]
        said += [f"{each.get('field')}: {each.get('message')}" for each in self.document.get("errors") or ()]
        return f"{self.status} {'; '.join(dict.fromkeys(said))}"


class Service:
    """A client. A context manager.

    Args:
        transport: for tests without a network.
    """

    def __init__(self, url: str, transport: httpx.BaseTransport | None = None) -> None:
        self._http = httpx.Client(base_url=url, timeout=HTTP_TIMEOUT_S, transport=transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._http.close()

    def has_task(self, task: str) -> bool:
        """Whether the service knows a task of that name."""
        return self._ask("GET", f"/tasks/{task}").status == 200

    def configure(self, task: str, settings: Mapping[str, Any]) -> None:
        """Set a task, which may be new."""
        self._need("PUT", f"/tasks/{task}", json=dict(settings))

    def upload(self, metadata: Mapping[str, Any], arrays: Mapping[str, Floats]) -> Answer:
        """One episode."""
        trajectory = io.BytesIO()
        np.savez_compressed(trajectory, allow_pickle=False, **arrays)
        files = {
            "metadata": ("metadata.json", json.dumps(metadata), "application/json"),
            "trajectory": ("trajectory.npz", trajectory.getvalue(), "application/octet-stream"),
        }
        return self._ask("POST", "/episodes", files=files)

    def keyframes(self, episode: str) -> list[dict[str, Any]]:
        """Of a stored episode, as the service finds them."""
        found: list[dict[str, Any]] = self._need("GET", f"/episodes/{episode}")["keyframes"]
        return found

    def predict(self, question: Mapping[str, Any]) -> Answer:
        """The answer, which may be a problem."""
        return self._ask("POST", "/predict", json={**question, "timeout_s": PREDICT_TIMEOUT_S})

    def record_outcome(self, prediction: str, *, success: bool) -> None:
        """Say how the execution of a prediction ended."""
        self._need("POST", f"/predictions/{prediction}/outcome", json={"success": success})

    def _need(self, method: str, path: str, **body: Any) -> dict[str, Any]:  # noqa: ANN401
        answer = self._ask(method, path, **body)
        if answer.problem is not None:
            raise ServiceError(f"{method} {path}: {answer.problem}")
        return answer.document

    def _ask(self, method: str, path: str, **body: Any) -> Answer:  # noqa: ANN401
        started_s = time.perf_counter()
        try:
            response = self._http.request(method, path, **body)
        except httpx.ReadTimeout:
            return Answer(504, {"title": "no answer in time"}, time.perf_counter() - started_s)
        except httpx.TransportError as error:
            raise ServiceError(f"{method} {path}: {error}") from error
        seconds = time.perf_counter() - started_s
        try:
            document = response.json()
        except ValueError:
            document = {"title": response.text[:200]}
        return Answer(response.status_code, document, seconds)
