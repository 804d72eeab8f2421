"""The detector in docs/objects.md, run as it stands there with a small network of ONNX's format that finds red."""

import re
from pathlib import Path

import cv2
import numpy as np

from tests.perception.solid_scene import cube, shoot

GUIDE = (Path(__file__).parents[2] / "docs" / "objects.md").read_text()
CELL_PX, SIZE_PX = 16, 640
BOX_PX = 64.0


def _number(value):
    """In protobuf's variable length."""
    return bytes([value]) if value < 128 else bytes([value & 127 | 128]) + _number(value >> 7)


def _field(number, *values):
    parts = [value.encode() if isinstance(value, str) else value for value in values]
    return b"".join(
        _number(number << 3) + _number(part)
        if isinstance(part, int)
        else _number(number << 3 | 2) + _number(len(part)) + part
        for part in parts
    )


def _tensor(name, array):
    kind = {np.dtype(np.float32): 1, np.dtype(np.int64): 7}[array.dtype]
    return _field(1, *array.shape) + _field(2, kind) + _field(8, name) + _field(9, array.tobytes())


def _value(name, *shape):
    dimensions = b"".join(_field(1, _field(1, size)) for size in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, 1) + _field(2, dimensions)))


def _node(kind, inputs, output, attributes=b""):
    return _field(1, *inputs) + _field(2, output) + _field(4, kind) + attributes


def _integers(name, *values):
    return _field(5, _field(1, name) + _field(8, *values) + _field(20, 7))


def red_finder():
    """A network whose score of a cell is how red it is, for class 1 of 2; see onnx.proto for the fields' numbers."""
    side = SIZE_PX // CELL_PX
    weights = np.zeros((2, 3, CELL_PX, CELL_PX), np.float32)
    weights[1] = np.array([1, -1, -1], np.float32)[:, None, None] / CELL_PX**2
    rows, columns = np.indices((side, side)).reshape(2, -1) * CELL_PX + CELL_PX / 2
    boxes = np.stack([columns, rows, np.full(side**2, BOX_PX), np.full(side**2, BOX_PX)])[None].astype(np.float32)
    cells = _integers("kernel_shape", CELL_PX, CELL_PX) + _integers("strides", CELL_PX, CELL_PX)
    axis = _field(5, _field(1, "axis") + _field(3, 1) + _field(20, 2))
    nodes = (
        _node("Conv", ["images", "weights"], "red", cells),
        _node("Reshape", ["red", "shape"], "scores"),
        _node("Concat", ["boxes", "scores"], "output0", axis),
    )
    tensors = {"weights": weights, "shape": np.array([1, 2, side**2]), "boxes": boxes}
    graph = _field(1, *nodes) + _field(2, "red") + _field(5, *(_tensor(*item) for item in tensors.items()))
    graph += _field(11, _value("images", 1, 3, SIZE_PX, SIZE_PX)) + _field(12, _value("output0", 1, 6, side**2))
    model = _field(1, 8) + _field(7, graph) + _field(8, _field(1, "") + _field(2, 13))
    return cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))


def test_the_guides_detector_masks_what_its_network_finds():
    (source,) = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    guide = {}
    exec(source.replace('{"mug": 41, "bottle": 39}', '{"mug": 0, "block": 1}'), guide)
    frame = shoot([cube("red", -0.1, 0), cube("blue", 0.1, 0)])
    masked = guide["masked"](frame, red_finder())
    red, blue = (frame.mask == number for number in (1, 2))
    assert red.sum() > 500
    assert np.isin(masked.mask[red], guide["MASK_IDS"]["block"]).all()
    assert not np.isin(masked.mask, guide["MASK_IDS"]["mug"]).any()
    assert np.mean(masked.mask[blue] > 0) < 0.2
    assert guide["MASK_IDS"] == {"mug": [1, 3], "block": [2, 3]}
    assert np.array_equal(masked.rgb, frame.rgb)
