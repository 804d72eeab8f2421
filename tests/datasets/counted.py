"""`python -m tests.datasets.counted FILE ...`: `roboprompt import FILE ...`, whose memory the system counts.

The last line that it writes is JSON: the exit status, and the most memory that one of the command's processes had.
"""

import json
import os
import runpy
import sys


def main():
    if (pid := os.fork()) == 0:
        sys.argv = ["app.cli", "import", *sys.argv[1:]]
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
        return
    _, status, used = os.wait4(pid, 0)
    counted = {"status": os.waitstatus_to_exitcode(status), "memory_mb": used.ru_maxrss // 1000}
    sys.stdout.write(f"{json.dumps(counted)}\n")


if __name__ == "__main__":
    main()
