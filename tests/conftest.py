import os
import signal
from tempfile import NamedTemporaryFile

import certifi
import pytest
from hypothesis import settings

import app.sim  # noqa: F401  it chooses MuJoCo's OpenGL, before a test imports MuJoCo

NO_BROWSER = "there is no Chromium"
pytest_plugins = ["tests.postgres", "tests.s3", "tests.stores"]

# The same examples on every run; a slow machine is no failure.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("repeatable")


# Nothing here speaks TLS. Every client of httpx would read all authorities of the world, 50 ms of a core: one will do.
AUTHORITY = NamedTemporaryFile("w", suffix=".pem")  # noqa: SIM115  as long as this process
AUTHORITY.write("".join(certifi.contents().partition("-----END CERTIFICATE-----\n")[:2]))
AUTHORITY.flush()
# Of this process and of those that tests start.
ENVIRONMENT = {
    "SSL_CERT_FILE": AUTHORITY.name,
    # Threads that wait for each other crawl where other tests share the cores.
    "ROBOPROMPT_EMBEDDED_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
os.environ.update(ENVIRONMENT)


def interrupt(number, frame):
    raise KeyboardInterrupt


def pytest_configure():
    """A shell that starts pytest in the background lets Ctrl-C be ignored, by what the tests start as well.

    For a handler of one's own `asyncio.run` puts none of its own in place, whose removal writes the result as text.
    """
    signal.signal(signal.SIGINT, interrupt)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    """Say after the summary how many tests a browser would have been needed for."""
    result = yield
    if (terminal := session.config.pluginmanager.get_plugin("terminalreporter")) is not None:
        number = sum(NO_BROWSER in str(report.longrepr) for report in terminal.stats.get("skipped", ()))
        if number:
            install = "apt-get install chromium, or playwright install chromium-headless-shell"
            terminal.write_line(f"{number} browser tests were not run: {install}", yellow=True)
    return result
