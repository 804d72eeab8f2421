"""The detector in docs/objects.md, run as it stands there with a network that finds red."""

import re
from pathlib import Path

import numpy as np

from tests.perception.solid_scene import cube, shoot

GUIDE = (Path(__file__).parents[2] / "docs" / "objects.md").read_text()
CELL_PX, SIZE_PX = 16, 640
BOX_PX = 64.0


class RedFinder:
    """In place of a network that cv2.dnn reads: its score of a cell, for class 1 of 2, is how red the cell is."""

    def setInput(self, blob):  # noqa: N802 - OpenCV's name
        side = SIZE_PX // CELL_PX
        red, green, blue = blob[0].reshape(3, side, CELL_PX, side, CELL_PX).mean(axis=(2, 4)).reshape(3, -1)
        rows, columns = np.indices((side, side)).reshape(2, -1) * CELL_PX + CELL_PX / 2
        size = np.full(side**2, BOX_PX)
        self.output = np.stack([columns, rows, size, size, np.zeros(side**2), red - green - blue])[None]

    def forward(self):
        return self.output


def test_the_guides_detector_masks_what_its_network_finds():
    (source,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    guide = {}
    exec(source.replace('{"mug": 41, "bottle": 39}', '{"mug": 0, "block": 1}'), guide)
    frame = shoot([cube("red", -0.1, 0), cube("blue", 0.1, 0)])
    masked = guide["masked"](frame, RedFinder())
    red, blue = (frame.mask == number for number in (1, 2))
    assert red.sum() > 500
    assert np.isin(masked.mask[red], guide["MASK_IDS"]["block"]).all()
    assert not np.isin(masked.mask, guide["MASK_IDS"]["mug"]).any()
    assert np.mean(masked.mask[blue] > 0) < 0.2
    assert guide["MASK_IDS"] == {"mug": [1, 3], "block": [2, 3]}
    assert np.array_equal(masked.rgb, frame.rgb)
