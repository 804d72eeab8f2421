"""`python -m app.evaluation.leash MODULE ...` runs a module that ends with its parent process.

Standard input is a pipe from the parent, which breaks when the parent ends, even if it was killed.
"""

import os
import runpy
import signal
import sys
import threading


def main() -> None:
    """Run the module that the command line names, as `python -m` would."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    while os.read(0, 1024):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
