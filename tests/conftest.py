import os
import signal

from hypothesis import settings

pytest_plugins = ["tests.postgres", "tests.s3"]

# The same examples on every run; a slow machine is no failure.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("repeatable")


# Of this process and of those that tests start.
ENVIRONMENT = {
    # Nothing here speaks TLS, and every client of httpx would read all authorities of the world: 50 ms of a core.
    "SSL_CERT_DIR": os.devnull,
    # Threads that wait for each other crawl where other tests share the cores.
    "ROBOPROMPT_EMBEDDED_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
os.environ.update(ENVIRONMENT)
os.environ.pop("SSL_CERT_FILE", None)


def pytest_configure():
    """A shell that starts pytest in the background lets Ctrl-C be ignored, by what the tests start as well."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
