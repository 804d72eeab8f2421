"""`roboprompt-robot doctor` where things are missing."""

import httpx
import pytest
from arms import client_of, type_command

from roboprompt_client import cli
from roboprompt_client.commands import check
from roboprompt_client.version import VERSION


@pytest.fixture
def results(monkeypatch, capsys):
    """What the command prints and returns, asking a service that answers as given, by path."""

    def run(answers, *words):
        def answer(request):
            return answers.get(request.url.path) or httpx.Response(403, json={"type": "/problems/forbidden"})

        monkeypatch.setattr(cli, "RoboPromptClient", lambda _: client_of(answer))
        return type_command(monkeypatch, "doctor", *words)[0], capsys.readouterr().out

    return run


def service(version):
    return {
        "/healthz": httpx.Response(200, json={"checks": {}}),
        "/openapi.json": httpx.Response(200, json={"info": {"version": version}}),
    }


def test_service_of_this_version(results):
    status, said = results(service(VERSION))
    assert status == 0
    assert f"ok    version: service {VERSION}" in said


def test_service_of_another_version_or_without_a_key(results):
    status, said = results(service("0.9.9"))
    assert (status, "look  version: service 0.9.9" in said) == (0, True)
    status, said = results({"/healthz": service(VERSION)["/healthz"]})
    assert (status, "look  key: may not read" in said) == (0, True)


def test_no_service_and_no_arm(results, tmp_path):
    status, said = results({"/healthz": httpx.Response(200, json={})}, "--robot", str(tmp_path / "cell.json"))
    assert status == 1
    assert "FAIL  service" in said
    assert "FAIL  arm: robot" in said


@pytest.mark.parametrize("extra", check.EXTRAS)
def test_missing_package_of_an_extra(extra, monkeypatch):
    monkeypatch.setattr(check, "find_spec", lambda _: None)
    result = check.look_at_extra(extra)
    assert (result.passed, result.detail.endswith(f"pip install 'roboprompt-client[{extra}]'")) == (None, True)
