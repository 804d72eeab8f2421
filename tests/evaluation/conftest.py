import pytest

from app.evaluation import server
from tests.forked import Forked


@pytest.fixture(scope="module", autouse=True)
def forked_services():
    """Services of this process's evaluations are forked; those of the commands in test_sweep_run.py are started."""

    def leashed(command, environment, log):
        arguments = ["app.evaluation.leash", *command]
        return Forked(arguments, environment, log, leashed=True, new_session=True)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "_leashed", leashed)
        yield
