import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.base import ObjectQuery
from app.perception.sightings import Miss, Sighting, fused
from app.pipeline.errors import ObjectNotVisibleError, UncertainPoseError
from roboprompt_client.types.quaternions import yaw_rad

QUERY = ObjectQuery("cube")


def turned(degrees):
    return Rotation.from_euler("z", degrees, degrees=True).as_quat()


def sighting(camera, x_m=0.0, yaw_deg=0.0, confidence=1.0, reason=""):
    return Sighting(camera, np.array([x_m, 0.0, 0.8]), turned(yaw_deg), confidence, reason)


def fuse(*found, **more):
    return fused(QUERY, found, estimator="test", **more)


def yaw_deg(pose):
    return np.degrees(yaw_rad(pose.quaternion_xyzw))


def test_positions_and_yaws_weigh_by_confidence():
    pose = fuse(sighting("a", 0.000, 10, 0.9), sighting("b", 0.004, 14, 0.6))
    np.testing.assert_allclose(pose.position_m, [0.0016, 0, 0.8])
    assert yaw_deg(pose) == pytest.approx(11.6, abs=0.01)
    assert pose.confidence == pytest.approx((0.81 + 0.36) / 1.5)
    assert (pose.name, pose.estimator, pose.cameras, pose.reason) == ("cube", "test", ("a", "b"), "")


def test_yaws_are_averaged_under_the_symmetry_and_given_in_the_canonical_turn():
    pose = fuse(sighting("a", 0, 44), sighting("b", 0, -44), yaw_symmetry_deg=90)
    assert abs(yaw_deg(pose)) == pytest.approx(45, abs=0.01)
    assert yaw_deg(fuse(sighting("a", 0, 182), sighting("b", 0, 4), yaw_symmetry_deg=180)) == pytest.approx(3)
    assert yaw_deg(fuse(sighting("a", 0, 50), sighting("b", 0, 170), yaw_symmetry_deg=0)) == pytest.approx(0, abs=1e-6)


def test_a_camera_below_the_threshold_does_not_count():
    pose = fuse(sighting("a", 0, 5), sighting("b", 0.5, 80, 0.4))
    assert pose.cameras == ("a",)
    assert pose.reason == "b, with confidence 0.40, puts it 50 cm away"
    np.testing.assert_allclose(pose.position_m, [0, 0, 0.8])


def test_a_sighting_without_rotation_leaves_none():
    bare = Sighting("b", np.array([0, 0, 0.8]), None, 1.0)
    assert fuse(sighting("a"), bare).quaternion_xyzw is None


def test_small_differences_are_mentioned_and_large_ones_refused():
    pose = fuse(sighting("a", 0, reason="half hidden"), sighting("b", 0.02, 12))
    assert (
        pose.reason == "a: half hidden; cameras a and b put it 2.0 cm apart; cameras a and b turn it 12 degrees apart"
    )
    for other, words in ((sighting("b", 0.04), "4.0 cm apart"), (sighting("b", 0, 30), "30 degrees apart")):
        with pytest.raises(UncertainPoseError, match=words) as caught:
            fuse(sighting("a"), other)
        assert caught.value.field == "objects[cube]"


def test_no_confident_sighting_is_refused_with_every_cameras_reason():
    misses = [Miss("c", "no pixel has its color")]
    with pytest.raises(UncertainPoseError) as caught:
        fuse(sighting("a", confidence=0.3, reason="10 % visible"), *misses)
    assert caught.value.message.endswith("a: confidence 0.30, 10 % visible; c: no pixel has its color")
    with pytest.raises(ObjectNotVisibleError, match="c: no pixel has its color"):
        fuse(*misses)
    with pytest.raises(UncertainPoseError, match="c: a round thing"):
        fuse(Miss("c", "a round thing", seen=True))
