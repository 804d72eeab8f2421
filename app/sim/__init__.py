"""A simulated Franka Panda with calibrated cameras and tasks (MuJoCo). Imports pipeline and client only.

MuJoCo reads MUJOCO_GL once, when it is first imported: which OpenGL it may use is decided here, before any module of
this package imports it.
"""

import ctypes
import ctypes.util
import os
import platform
import sys

# In order of preference: a GPU or software device without a display, then software only.
BACKENDS = {"egl": "EGL", "osmesa": "OSMesa"}
NO_OPENGL = "disable"


def select_backend() -> None:
    """Set MUJOCO_GL to a backend whose library loads, on Linux and where the user has not set it.

    `import mujoco` fails if MUJOCO_GL names a backend whose library is missing, and asks for a display if it is unset.
    Once MuJoCo is imported, the choice has been made: nothing is changed.
    """
    if platform.system() != "Linux" or "MUJOCO_GL" in os.environ or "mujoco" in sys.modules:
        return
    usable = (backend for backend, library in BACKENDS.items() if _loads(library))
    os.environ["MUJOCO_GL"] = next(usable, NO_OPENGL)


def _loads(library: str) -> bool:
    path = ctypes.util.find_library(library)
    if path is None:
        return False
    try:
        ctypes.CDLL(path)
    except OSError:
        return False
    return True


select_backend()
