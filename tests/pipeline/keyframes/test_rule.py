import math

import pytest

from app.pipeline.keyframes import KeyframeRule
from roboprompt_client.errors import InvalidInputError


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"rule": "median"}, "keyframes.rule"),
        ({"delta_rad_s": 0.0}, "keyframes.delta_rad_s"),
        ({"delta_rad_s": -1.0}, "keyframes.delta_rad_s"),
        ({"delta_rad_s": math.nan}, "keyframes.delta_rad_s"),
        ({"delta_rad_s": math.inf}, "keyframes.delta_rad_s"),
        ({"interval": 0}, "keyframes.interval"),
        ({"tolerance_m": 0.0}, "keyframes.tolerance_m"),
        ({"tolerance_m": math.nan}, "keyframes.tolerance_m"),
        ({"tolerance_deg": -5.0}, "keyframes.tolerance_deg"),
        ({"tolerance_deg": math.inf}, "keyframes.tolerance_deg"),
    ],
)
def test_a_rule_that_makes_no_sense_is_refused(values, field):
    with pytest.raises(InvalidInputError) as caught:
        KeyframeRule(**values)
    assert caught.value.field == field
