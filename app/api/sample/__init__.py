"""A demonstration to try an upload with: `stack_cube` as the simulator recorded it, with the picture of one camera."""

import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
FILES = {
    "metadata.json": "application/json",
    "trajectory.npz": "application/octet-stream",
    "rgb_front.jpg": "image/jpeg",
}
METADATA: dict[str, Any] = json.loads((FOLDER / "metadata.json").read_text())
