"""The list of color words against what people called them: the xkcd color survey, as matplotlib has it."""

import math

import numpy as np
import pytest
from matplotlib.colors import XKCD_COLORS, to_rgb

from app.pipeline.order.vocabulary import BASIC, COLORS, look_alike

HUED = sorted(BASIC - {"black", "white", "grey", "brown"})
# Björn Ottosson, "A perceptual color space for image processing" (2020)
TO_LMS = np.array([[0.41222, 0.53633, 0.05145], [0.21190, 0.68070, 0.10740], [0.08830, 0.28172, 0.62998]])
TO_OKLAB = np.array([[0.21045, 0.79362, -0.00407], [1.97800, -2.42859, 0.45059], [0.02590, 0.78277, -0.80868]])
SHADES = sorted(
    word
    for word, names in COLORS.items()
    if word not in BASIC and len(names) == 1 and names <= set(HUED) and f"xkcd:{word}" in XKCD_COLORS
)
MAX_HUE_DEG = 45.0


def hue_deg(word):
    rgb = np.array(to_rgb(f"xkcd:{word}"))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    _, a, b = TO_OKLAB @ np.cbrt(TO_LMS @ linear)
    return math.degrees(math.atan2(b, a))


def apart_deg(one, other):
    return abs((hue_deg(one) - hue_deg(other) + 180) % 360 - 180)


@pytest.mark.parametrize("word", SHADES)
def test_a_shade_has_the_hue_of_its_basic_color(word):
    (basic,) = COLORS[word]
    assert apart_deg(word, basic) < MAX_HUE_DEG


def test_most_of_the_list_is_held_against_the_survey():
    assert len(SHADES) > 40


def test_no_basic_color_stands_for_another():
    assert [(one, other) for one in BASIC for other in BASIC if look_alike(one, other) and one != other] == []
