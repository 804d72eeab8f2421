import signal

from hypothesis import settings

pytest_plugins = ["tests.postgres", "tests.s3"]

# The same examples on every run; a slow machine is no failure.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("repeatable")


def pytest_configure():
    """A shell that starts pytest in the background lets Ctrl-C be ignored, by what the tests start as well."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
