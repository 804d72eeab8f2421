"""Damaged files and replies: either a valid value or the error that the service answers with, whatever the bytes.

`ROBOPROMPT_FUZZ_EXAMPLES` sets how many of each.
"""

import io
import os

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.perception.images import decode_depth, decode_mask, decode_rgb
from app.pipeline.errors import ReplyParseError
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.motion.limits import MAX_ACTIONS
from roboprompt_client.types.trajectory import Trajectory
from tests.episodes import arrays, npz, pick_trajectory
from tests.pipeline.asking import codec_of, parse_reply
from tests.pipeline.scenes import WORKSPACE, action, demonstration, pose

many = settings(
    max_examples=int(os.environ.get("ROBOPROMPT_FUZZ_EXAMPLES", "150")),
    suppress_health_check=[HealthCheck.too_slow],
)


def stored(**named):
    stream = io.BytesIO()
    np.savez(stream, **named)
    return stream.getvalue()


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def encoded(kind, array):
    return cv2.imencode(kind, array)[1].tobytes()


NOISE = np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8)
IDS = NOISE[:, :, 0].astype(np.uint16)
ARCHIVES = [npz(**arrays(pick_trajectory((0.1, 0.2, 0.8)))), stored(**arrays(pick_trajectory((0.1, 0.2, 0.8))))]
RGB = [encoded(".png", NOISE), encoded(".jpg", NOISE), npy(NOISE)]
DEPTH = [encoded(".png", IDS), npy(IDS.astype(np.float32)), npy(IDS.astype(np.float16))]
MASK = [encoded(".png", IDS), npy(IDS), npy(IDS.astype(np.int64))]


@st.composite
def damaged(draw, originals):
    """One of the files with bytes overwritten, cut out, doubled or put in."""
    data = bytearray(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(data)))
        end = min(len(data), start + draw(st.integers(0, 12)))
        patch = draw(st.binary(max_size=8) | st.sampled_from([b"\xff" * 8, b"\0" * 8, bytes(data[start:end]) * 2]))
        data[start:end] = patch
    return bytes(data)


@many
@given(damaged(ARCHIVES) | st.binary(max_size=200))
def test_trajectory_file(data):
    try:
        trajectory = trajectory_from_npz(data)
    except InvalidInputError:
        return
    assert isinstance(trajectory, Trajectory)
    assert all(np.isfinite(array).all() for array in vars(trajectory).values() if array is not None)


@pytest.mark.parametrize(
    ("originals", "decode", "dtype"),
    [
        (RGB, decode_rgb, np.uint8),
        (DEPTH, lambda field, data: decode_depth(field, data, 0.001), np.float32),
        (MASK, decode_mask, np.int32),
    ],
)
def test_image_file(originals, decode, dtype):
    @many
    @given(damaged(originals) | st.binary(max_size=100))
    def check(data):
        try:
            image = decode("front", data)
        except InvalidInputError:
            return
        assert image.dtype == dtype
        assert image.size

    check()


CUP = pose("cup", (0.1, 0.2, 0.7), 30)
SHOWN = demonstration("lift the cup", [CUP], [action((0.1, 0.2, 0.8)), action((0.1, 0.2, 0.9), gripper_open=False)])
WORDS = st.sampled_from(
    ["[", "]", "[[", "]]", ", ", ";", ":", " ", "\n", "```", "json", "A", "w", "o", "1", "36", "-", "+0"]
)
NUMBERS = st.integers(-200, 200).map(str) | st.floats().map(str) | st.sampled_from(["1e999", "٣", "0x10", "9" * 5000])
ROWS = ["[46, 74, 55, 54, 36, 37, 1]", "1 A w: +0 +0 +20 0 36 36 1; ", "2 A o: -10 +2 +40 71 36 0 0", "1. grasp cup\n"]
TEXTS = st.lists(WORDS | NUMBERS | st.sampled_from(ROWS) | st.text(max_size=3), max_size=30).map("".join)


@pytest.mark.parametrize("representation", ["absolute", "object_frame", "action_tokens", "parts"])
def test_reply(representation):
    codec = codec_of(representation, "paper", [SHOWN], WORKSPACE)

    @many
    @given(TEXTS)
    def check(text):
        try:
            actions = parse_reply(text, codec, [CUP], "lift the cup")
        except ReplyParseError:
            return
        assert 1 <= len(actions) <= MAX_ACTIONS
        for item in actions:
            assert np.isfinite(item.position_m).all()
            assert np.linalg.norm(item.quaternion_xyzw) == pytest.approx(1)

    check()
