"""Commands of the app in processes that need not import it again: forked from one that has.

To import the app takes three seconds of a core, to fork a process that has done so a hundredth. What is run is the
same as by `python -m MODULE ...`: a process of its own, with its own environment, folder and files, that ends as the
module lets it. The workers of `serve --workers` are forked as well, where uvicorn would start each from nothing;
tests/e2e/test_workers.py has those. `python -m tests.forked FD` is the process that is forked; the tests talk to it
through `Forked`.
"""

import atexit
import contextlib
import gc
import json
import multiprocessing
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryFile

IMPORTED = (
    "app.cli.serve",
    "uvicorn.lifespan.on",
    "uvicorn.loops.auto",
    "uvicorn.protocols.http.h11_impl",
)
REQUEST_BYTES = 1 << 18
NUM_FILES = 4  # standard input, output and error, and where the exit status goes


class Forked:
    """Runs `python -m MODULE ...`; as far as tests use it, a `subprocess.Popen`.

    Args:
        arguments: the module and what follows.
        environment: in addition to that of this process.
        output: file of standard output, and of standard error unless there are `errors`.
        leashed: whether standard input is a pipe that ends with this process, instead of nothing.
        keys: file of standard input.
        new_session: whether it is out of reach of this terminal's Ctrl-C.
    """

    def __init__(self, arguments, environment, output, errors=None, *, leashed=False, keys=None, new_session=False):
        self.args, self.returncode = arguments, None
        self._status, status = os.pipe()
        held, self.stdin = None, None
        if leashed:
            held, write = os.pipe()
            self.stdin = os.fdopen(write, "wb", buffering=0)
        request = {
            "arguments": [str(argument) for argument in arguments],
            "environment": {**os.environ, **environment},
            "folder": os.getcwd(),
            "new_session": new_session,
        }
        with open(os.devnull) as nothing:
            stdin = (keys or nothing).fileno() if held is None else held
            files = [stdin, output.fileno(), (errors or output).fileno(), status]
            self.pid = _template().fork(request, files)
        os.close(status)
        if held is not None:
            os.close(held)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.stdin is not None:
            self.stdin.close()
        self.wait()

    def poll(self):
        return self._wait(0)

    def wait(self, timeout=None):
        if self._wait(timeout) is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return self.returncode

    def send_signal(self, number):
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self):
        self.send_signal(signal.SIGTERM)

    def kill(self):
        self.send_signal(signal.SIGKILL)

    def _wait(self, timeout):
        if self.returncode is None and select.select([self._status], [], [], timeout)[0]:
            self.returncode = os.waitstatus_to_exitcode(int(os.read(self._status, 100)))
            os.close(self._status)
        return self.returncode


def run(*arguments, timeout_s=120.0):
    """What `subprocess.run` returns of `python -m MODULE ...`, with what it wrote as texts."""
    with TemporaryFile("w+") as output, TemporaryFile("w+") as errors:
        process = Forked(arguments, {}, output, errors)
        try:
            process.wait(timeout_s)
        finally:
            process.kill()
        for file in (output, errors):
            file.seek(0)
        return subprocess.CompletedProcess(process.args, process.returncode, output.read(), errors.read())


class _Template:
    """The process that is forked, from here."""

    def __init__(self):
        self._socket, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, REQUEST_BYTES)
        with other:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.forked", str(other.fileno())],
                cwd=Path(__file__).parents[1],
                pass_fds=[other.fileno()],
                start_new_session=True,
            )
        atexit.register(self.close)

    def fork(self, request, files):
        socket.send_fds(self._socket, [json.dumps(request).encode()], files)
        return int(self._socket.recv(100))

    def close(self):
        self._socket.close()
        self._process.wait()


_templates = []


def _template():
    if not _templates:
        _templates.append(_Template())
    return _templates[0]


def _serve(connection):
    """Fork for each request, until the connection ends; in the forked process return the module's name."""
    statuses = {}  # by process id
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    while True:
        ready, _, _ = select.select([connection, woken], [], [])
        if woken in ready:
            os.read(woken, 1000)
            _tell_who_ended(statuses)
        if connection in ready:
            message, files, _, _ = socket.recv_fds(connection, REQUEST_BYTES, NUM_FILES)
            if not message:
                return None
            if (pid := os.fork()) == 0:
                signal.set_wakeup_fd(-1)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                for descriptor in (woken, wake, *statuses.values()):
                    os.close(descriptor)
                request = json.loads(message)
                if request["new_session"]:
                    os.setsid()
                connection.send(str(os.getpid()).encode())
                connection.close()
                return _become(request, files)
            *given, statuses[pid] = files
            for descriptor in given:
                os.close(descriptor)


def _tell_who_ended(statuses):
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            with contextlib.suppress(BrokenPipeError):
                os.write(descriptor := statuses.pop(ended[0]), str(ended[1]).encode())
            os.close(descriptor)


def _become(request, files):
    *standard, status = files
    os.close(status)
    for number, descriptor in enumerate(standard):
        os.dup2(descriptor, number)
    for descriptor in standard:
        os.close(descriptor)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    sys.argv = request["arguments"]
    return sys.argv[0]


def _fork_workers():
    """Let uvicorn fork its workers, without the supervisor's handlers: SIGTERM ends one that does not serve yet."""
    from uvicorn import _subprocess

    _subprocess.spawn = multiprocessing.get_context("fork")
    os.register_at_fork(after_in_child=lambda: signal.signal(signal.SIGTERM, signal.SIG_DFL))


def main():
    """Import, then be forked; the forked run the module as `python -m` does."""
    connection = socket.socket(fileno=int(sys.argv[1]))
    for module in IMPORTED:
        __import__(module)
    gc.freeze()
    if module := _serve(connection):
        _fork_workers()
        runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
