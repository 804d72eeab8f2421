"""Small requests that mean much work, each as an attacker would write it."""

import base64
import copy
import functools
import io
import json
import struct
import zipfile
import zlib

import cv2
import msgpack
import numpy as np

from tests.episodes import camera

QUESTION = {
    "task": "pick",
    "instruction": "pick up the cube",
    "objects": [{"name": "cube", "position": [0.1, 0.1, 0.8]}],
}
START_OF_SCAN = b"\xff\xda"


def packed_lists(rows, columns=4096):
    """MessagePack: a byte for each empty list."""
    many = msgpack.packb([[]] * columns)
    head = msgpack.packb({**QUESTION, "episode_ids": 0})[:-1]
    return head + b"\xdd" + struct.pack(">I", rows) + many * rows


def json_lists(number):
    """JSON: three bytes for each empty list."""
    return json.dumps(QUESTION)[:-1].encode() + b', "episode_ids": [' + b"[]," * number + b"[]]}"


def json_keys(number):
    """JSON with so many keys that nobody knows: each is an error of its own."""
    return json.dumps({**QUESTION, **{f"unknown{k}": 1 for k in range(number)}}).encode()


def json_in_utf16(number):
    """Lists after a letter whose bytes look like a quotation mark."""
    return json.dumps({"\u2222": [[]] * number}, ensure_ascii=False).encode("utf-16")


def json_number(digits):
    """JSON with a number that no computer counts to."""
    return json.dumps({**QUESTION, "seed": 0})[:-2].encode() + b"9" * digits + b"}"


def json_depth(depth):
    """JSON: lists in lists."""
    return json.dumps(QUESTION)[:-1].encode() + b', "episode_ids": ' + b"[" * depth + b"]" * depth + b"}"


@functools.cache
def flat_jpeg(width, height):
    """A grey picture in few bytes."""
    return cv2.imencode(".jpg", np.full((height, width, 3), 128, np.uint8))[1].tobytes()


@functools.cache
def many_scans(width, height, number):
    """A progressive JPEG whose last scan is repeated until there are `number`."""
    grey = np.full((height, width), 128, np.uint8)
    whole = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    last = whole.rindex(START_OF_SCAN)
    missing = number - whole.count(START_OF_SCAN)
    return whole[:-2] + whole[last:-2] * missing + whole[-2:]


def with_cameras(number, data, width, height):
    """The document and the parts of a request with the same color image from so many cameras."""
    names = [f"c{k}" for k in range(number)]
    listed = [camera(name, width, height) for name in names]
    return {**QUESTION, "cameras": listed}, {f"rgb_{name}": (name, data) for name in names}


def png_chunk(kind, data):
    """A PNG's chunk."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_with(chunk, number, width=64, height=48):
    """A small picture with a chunk of so many copies after its header."""
    whole = cv2.imencode(".png", np.zeros((height, width, 3), np.uint8))[1].tobytes()
    return whole[:33] + chunk * number + whole[33:]


def text_bomb(unpacked_bytes):
    """A chunk of compressed text."""
    return png_chunk(b"zTXt", b"Comment\0\0" + zlib.compress(b"a" * unpacked_bytes, 9))


def jpeg(image):
    """As a camera would send it."""
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


def in_base64(document, images):
    """One JSON document with the images in it."""
    return json.dumps({**document, **{name: base64.b64encode(data).decode() for name, data in images.items()}}).encode()


def zip_of_many(number):
    """An archive with a directory of so many entries."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for index in range(number):
            archive.writestr(str(index), b"")
    return stream.getvalue()


def zip_of_one_many_times(number, unpacked_bytes):
    """An archive whose directory names one large member again and again, all but one of them as empty."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("gripper_open.npy", bytes(unpacked_bytes))
        large = archive.infolist()[0]
        small = copy.copy(large)
        small.file_size = 0
        archive.filelist[:0] = [small] * number
        archive.filelist[-1] = large
        archive._didModify = True
    return stream.getvalue()
