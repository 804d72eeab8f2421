import pytest

from roboprompt_client.connection import is_own_machine, without_proxy


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
    assert is_own_machine(url)
    assert without_proxy(url) == {"http://": None, "https://": None}


@pytest.mark.parametrize(
    "url",
    ["http://gpu-box:8000", "http://127.0.0.1.example", "http://127.0.0.1@example", "", "http://[", "http://0.0.0.0"],
)
def test_another(url):
    assert not is_own_machine(url)
    assert without_proxy(url) is None
