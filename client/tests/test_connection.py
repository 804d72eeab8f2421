"""Whom a client reaches without a proxy, and with which key."""

import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.http import without_proxy


@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1:8000/v1",
        "http://127.1.2.3",
        "https://localhost",
        "http://[::1]:9000/poses",
        "http://a.localhost",
    ],
)
def test_this_machine(url):
    assert without_proxy(url) == {"http://": None, "https://": None}


@pytest.mark.parametrize(
    "url",
    ["http://gpu-box:8000", "http://127.0.0.1.example", "http://127.0.0.1@example", "", "http://[", "http://0.0.0.0"],
)
def test_another(url):
    assert without_proxy(url) is None


@pytest.mark.parametrize("key", ["ключ", "rp_1 2", "rp_1\n"])
def test_a_key_that_no_header_can_have_is_named(key):
    with pytest.raises(InvalidInputError, match="api_key: has blanks, or letters outside ASCII"):
        RoboPromptClient("http://robots", api_key=key)
