"""Likely faults of images in which an object was not found: missing depth, a bumped camera, exposure, BGR colors."""

import numpy as np

from app.perception.frame_checks import are_swapped
from app.perception.registered.depth_view import DepthView
from app.perception.registered.scene import LitScene, Scene
from app.perception.registered.template import SAME_LIGHT_LAB, Template
from roboprompt_client.cameras.table import MAX_OFF_M, OTHER_M, find_flat_surface
from roboprompt_client.types.camera import RgbdFrame

OTHER_TABLE_RGB = 25.0  # of 255
OTHER_BRIGHTNESS, MIN_OTHERS = 1.4, 2  # ratio of one camera's table to the median of at least so many others
STEP_PX = 4  # stride of the pixels that are checked for missing depth
MIN_PIXELS, MIN_SHARE = 200, 0.8  # of pixels of the object's colors, without depth, to be reported


def image_faults(template: Template, lit: LitScene) -> str:
    """Return likely faults of images in which an object was not found, as the end of a message; may be empty."""
    notes = [_without_depth(template, lit, number) for number in range(len(lit.scene.views))]
    notes += [_bumped(view, lit.scene) for view in lit.scene.views]
    notes += [_colored_otherwise(view, lit.scene) for view in lit.scene.views]
    taught_rgb, table = template.table_rgb, lit.scene.table
    if are_swapped(taught_rgb, table.rgb):
        notes.append("the table has its taught color if red and blue change places: BGR images?")
    elif np.abs(taught_rgb - table.rgb).max() > OTHER_TABLE_RGB:
        notes.append("the table looks otherwise than in its labeled views")
    return "".join(f"; {note}" for note in notes if note)


def _bumped(view: DepthView, scene: Scene) -> str:
    surface = find_flat_surface(RgbdFrame(view.camera, None, view.depth_m))
    off_m = 0.0 if surface is None else float(scene.table.height_m(surface.middle_m[None])[0])
    if not MAX_OFF_M < abs(off_m) < OTHER_M:
        return ""
    return f"{view.camera.name} sees the table {1000 * off_m:+.0f} mm off: was the camera bumped?"


def _colored_otherwise(view: DepthView, scene: Scene) -> str:
    """Return how the table looks in one camera if it looks otherwise in the others together."""
    own, *others = (scene.table_rgb_in(item) for item in (view, *(item for item in scene.views if item is not view)))
    known = [rgb for rgb in others if rgb is not None]
    if own is None or len(known) < MIN_OTHERS:
        return ""
    usual = np.median(known, axis=0)
    if are_swapped(usual, own):
        return f"{view.camera.name} shows the others' table with red and blue exchanged: BGR images?"
    times = float(own.sum() / max(usual.sum(), 1.0))
    if max(times, 1 / max(times, 0.01)) < OTHER_BRIGHTNESS:
        return ""
    return f"{view.camera.name} shows the table {times:.1f} times as bright as the others: the same exposure for all?"


def _without_depth(template: Template, lit: LitScene, number: int) -> str:
    view = lit.scene.views[number]
    rows, columns = STEP_PX * np.indices(view.depth_m[::STEP_PX, ::STEP_PX].shape).reshape(2, -1)
    off_lab, _ = template.palette.query(lit.lab_at(number, rows, columns), distance_upper_bound=SAME_LIGHT_LAB)
    depths_m = view.depth_m[rows, columns][np.isfinite(off_lab)]
    unknown = int(np.count_nonzero(depths_m == 0))
    if unknown * STEP_PX**2 < MIN_PIXELS or unknown < MIN_SHARE * len(depths_m):
        return ""
    return f"{view.camera.name} has no depth for {100 * unknown / len(depths_m):.0f} % of the pixels of its colors"
