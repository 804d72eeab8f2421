import pytest

from app.evaluation import server
from app.evaluation.teach import upload
from tests.forked import Forked


@pytest.fixture(scope="module", autouse=True)
def forked_services():
    """Services of this process's evaluations are forked; those of the commands in test_sweep_run.py are started."""

    def leashed(command, environment, log):
        arguments = ["app.evaluation.server", *command]
        return Forked(arguments, environment, log, leashed=True, new_session=True)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "_leashed", leashed)
        yield


@pytest.fixture
def lessons(monkeypatch):
    """What runs teach meanwhile, in their order."""
    taught = []

    def kept(*arguments):
        taught.append(upload(*arguments))
        return taught[-1]

    monkeypatch.setattr("app.evaluation.run.upload", kept)
    return taught
