"""Headers of reverse proxies are believed from those that the operator names, and from nobody else."""

import re

import httpx
import pytest
from pydantic import ValidationError

from app.services.api_keys import create_key
from app.settings import Settings
from app.store.store import Store
from tests.e2e.processes import killable_server

SLOW = {"ROBOPROMPT_AUTH": "on", "ROBOPROMPT_RATE_LIMIT_PER_S": "0.01", "ROBOPROMPT_RATE_LIMIT_BURST": "3"}
TRUSTED = {"ROBOPROMPT_TRUSTED_PROXIES": '["127.0.0.1", "10.1.0.0/16"]'}


def guesses(url, number, *, forwarded):
    """Statuses of somebody without a key who names a new address each time."""
    answers = [
        httpx.get(f"{url}/tasks", headers={"x-forwarded-for": forwarded.format(k)}).status_code for k in range(number)
    ]
    return sorted(answers)


def login_cookie(url, key):
    answer = httpx.post(f"{url}/ui/login", data={"key": key}, headers={"x-forwarded-proto": "https"})
    return answer.headers["set-cookie"].lower()


@pytest.fixture
def key(tmp_path):
    store = Store.open(tmp_path)
    token = create_key(store, "person", ["read"])
    store.close()
    return token


def logged_addresses(tmp_path):
    return set(re.findall(r"INFO: +([\d.]+):\d+ - ", (tmp_path / "server.log").read_text()))


def test_forwarded_addresses_are_ignored_by_default(tmp_path, key, monkeypatch):
    monkeypatch.setenv("FORWARDED_ALLOW_IPS", "*")  # which uvicorn would follow
    with killable_server(tmp_path, SLOW) as (_, url):
        assert "secure" not in login_cookie(url, key)
        assert guesses(url, 6, forwarded="10.0.0.{}") == [401] * 2 + [429] * 4
    assert logged_addresses(tmp_path) == {"127.0.0.1"}


def test_forwarded_addresses_of_named_proxies_are_used(tmp_path, key):
    with killable_server(tmp_path, {**SLOW, **TRUSTED}) as (_, url):
        assert "secure" in login_cookie(url, key)
        assert guesses(url, 6, forwarded="10.0.0.{}") == [401] * 6
        # whoever is behind a proxy may write what they like before what the proxy adds
        assert guesses(url, 6, forwarded="192.0.2.{}, 10.9.9.9") == [401] * 3 + [429] * 3
        assert guesses(url, 6, forwarded="192.0.2.{}, 10.8.8.8, 10.1.2.3") == [401] * 3 + [429] * 3
    assert "10.0.0.5" in logged_addresses(tmp_path)


@pytest.mark.parametrize("wrong", ["*", "proxy.example", "10.0.0.1/8", "127.0.0.1:80", ""])
def test_invalid_proxy_addresses_are_refused(wrong):
    with pytest.raises(ValidationError, match="trusted_proxies"):
        Settings(trusted_proxies=(wrong,))
