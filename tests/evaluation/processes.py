"""What runs, from /proc."""

from pathlib import Path


def _stat(pid):
    """State and parent of a process; None where there is none."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    except OSError:
        return None
    return fields[0], int(fields[1])


def alive(pid):
    """Whether a process runs; one that ended and was not waited for does not."""
    stat = _stat(pid)
    return stat is not None and stat[0] != "Z"


def descendants(pid):
    """The processes that a process has started, and those that they have."""
    parents = {int(path.name): _stat(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()}
    children = [child for child, stat in parents.items() if stat is not None and stat[1] == pid]
    return children + [process for child in children for process in descendants(child)]
