"""Small images that mean much work, each as an attacker would write it."""

import functools
import struct
import zlib

import cv2
import numpy as np

START_OF_SCAN = b"\xff\xda"


@functools.cache
def many_scans(width, height, number):
    """A progressive JPEG whose last scan is repeated until there are `number`."""
    grey = np.full((height, width), 128, np.uint8)
    whole = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    last = whole.rindex(START_OF_SCAN)
    missing = number - whole.count(START_OF_SCAN)
    return whole[:-2] + whole[last:-2] * missing + whole[-2:]


def png_chunk(kind, data):
    """A PNG's chunk."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_with(chunk, number, width=64, height=48):
    """A small picture with a chunk of so many copies after its header."""
    whole = cv2.imencode(".png", np.zeros((height, width, 3), np.uint8))[1].tobytes()
    return whole[:33] + chunk * number + whole[33:]
