"""The processes of embedded models."""

import os


def child_pids():
    """The llama.cpp processes that this one has started."""
    pids = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat") as stat, open(f"/proc/{pid}/cmdline") as command:
                fields = stat.read().rpartition(")")[2].split()
                if int(fields[1]) == os.getpid() and fields[0] != "Z" and "llama/child" in command.read():
                    pids.append(int(pid))
        except OSError:
            continue
    return set(pids)
