"""Simulations on a Ray cluster (extra `ray`)."""

import logging
import os
from collections.abc import Callable
from concurrent.futures import Future
from importlib import import_module
from typing import Any

from app.evaluation.executors import Result
from app.evaluation.failures import RayMissingError

LOCAL = "local"


class RayExecutor:
    """A Ray task for each function. The cluster's machines must have this package with its extra `sim` installed.

    Args:
        address: of a running cluster, `auto` for the one of this machine; `local` starts one here.

    Raises:
        RayMissingError; ConnectionError: if no cluster answers there.
    """

    def __init__(self, address: str = LOCAL) -> None:
        os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
        try:
            self._ray: Any = import_module("ray")
        except ModuleNotFoundError as error:
            raise RayMissingError("--ray needs Ray: pip install 'roboprompt[ray]'") from error
        dashboard = False if address == LOCAL else None
        self._ray.init(address=address, include_dashboard=dashboard, log_to_driver=False, logging_level=logging.ERROR)
        self.workers = int(self._ray.cluster_resources()["CPU"])
        self.description = f"Ray ({address}), {self.workers} CPUs"
        self._run: Any = self._ray.remote(_run)
        self._pending: set[Future[Any]] = set()

    def submit(self, job: Callable[..., Result], /, *arguments: object) -> Future[Result]:
        """Run a module's function in the cluster; arguments and result can be pickled."""
        future: Future[Result] = self._run.remote(job, *arguments).future()
        self._pending.add(future)
        future.add_done_callback(self._pending.discard)
        return future

    def close(self) -> None:
        """Leave the cluster, or end the one that was started here."""
        self._ray.shutdown()
        for future in list(self._pending):  # Ray would let those who wait for them wait forever
            future.cancel()


def _run(job: Callable[..., Result], /, *arguments: object) -> Result:
    return job(*arguments)
