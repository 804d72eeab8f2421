"""What may be wrong with images in which an object is not found, as far as it shows."""

import numpy as np

from app.perception.registered.candidates import SAME_LAB
from app.perception.registered.scene import LitScene
from app.perception.registered.template import Template

SWAPPED_OFF = 0.03  # of a table's share of red and blue from the taught one; shadows and lamps make less
STEP_PX = 4  # of the pixels that are looked at
MIN_PIXELS, MIN_SHARE = 200, 0.8  # of the object's colors and without depth


def causes(template: Template, lit: LitScene) -> str:
    """In words, to follow a message; empty if nothing is seen."""
    notes = [_without_depth(template, lit, number) for number in range(len(lit.scene.views))]
    if _is_swapped(template, lit):
        notes.append("the table has its taught color if red and blue change places: BGR images?")
    return "".join(f"; {note}" for note in notes if note)


def _is_swapped(template: Template, lit: LitScene) -> bool:
    taught, seen = (rgb / max(rgb.sum(), 1.0) for rgb in (template.table_rgb, lit.scene.table.rgb))
    off, off_swapped = np.linalg.norm(seen - taught), np.linalg.norm(seen[::-1] - taught)
    return bool(off > SWAPPED_OFF and off_swapped < off / 2)


def _without_depth(template: Template, lit: LitScene, number: int) -> str:
    view = lit.scene.views[number]
    rows, columns = STEP_PX * np.indices(view.depth_m[::STEP_PX, ::STEP_PX].shape).reshape(2, -1)
    off_lab, _ = template.palette.query(lit.lab_at(number, rows, columns), distance_upper_bound=SAME_LAB)
    depths_m = view.depth_m[rows, columns][np.isfinite(off_lab)]
    unknown = int(np.count_nonzero(depths_m == 0))
    if unknown * STEP_PX**2 < MIN_PIXELS or unknown < MIN_SHARE * len(depths_m):
        return ""
    return f"{view.camera.name} has no depth for {100 * unknown / len(depths_m):.0f} % of the pixels of its colors"
