import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.perception.cuboid.model import SHAPES
from app.perception.cuboid.shape import outline_points_m, ray_distances_m, surface_distances_m

SIZES_M = {"box": (0.08, 0.05, 0.03), "cylinder": (0.06, 0.06, 0.04)}
EYE_M = np.array([0.5, 0.4, 0.6])


def candidate(shape, yaw_rad=0.7):
    return np.array([0.1, -0.05, 0.2, yaw_rad, *SIZES_M[shape]])


def own_frame(shape, points_m):
    c = candidate(shape)
    return Rotation.from_euler("z", -c[3]).apply(points_m - c[:3])


def inside(shape, points_m):
    local, half = np.abs(own_frame(shape, points_m)), np.array(SIZES_M[shape]) / 2
    if shape == "cylinder":
        return (np.hypot(local[:, 0], local[:, 1]) < half[0]) & (local[:, 2] < half[2])
    return (local < half).all(axis=1)


def surface(shape, random, count=4000):
    """Points on the surface: random ones pushed onto it along the ray from the middle."""
    outward = random.standard_normal((count, 3))
    low, high = np.zeros(count), np.full(count, 1.0)
    for _ in range(40):
        middle = (low + high) / 2
        within = inside(shape, candidate(shape)[:3] + outward * middle[:, None])
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return candidate(shape)[:3] + outward * low[:, None]


@pytest.mark.parametrize("shape", SHAPES)
def test_distances_from_the_surface_are_those_of_the_nearest_of_its_points(shape):
    random = np.random.default_rng(0)
    points_m = candidate(shape)[:3] + random.uniform(-0.06, 0.06, (200, 3))
    found = surface_distances_m(shape, candidate(shape)[None], points_m)[0]
    np.testing.assert_array_equal(found < 0, inside(shape, points_m))
    nearest = np.linalg.norm(points_m[:, None] - surface(shape, random)[None], axis=2).min(axis=1)
    np.testing.assert_allclose(np.abs(found), nearest, atol=0.004)  # the sample's own spacing
    assert np.mean(nearest - np.abs(found)) < 0.0015


@pytest.mark.parametrize("shape", SHAPES)
def test_rays_hit_where_their_distance_is_negative(shape):
    random = np.random.default_rng(1)
    targets_m = candidate(shape)[:3] + random.uniform(-0.07, 0.07, (300, 3))
    rays = (targets_m - EYE_M) / np.linalg.norm(targets_m - EYE_M, axis=1, keepdims=True)
    found = ray_distances_m(shape, candidate(shape)[None], EYE_M, rays)[0]
    along_m = np.linspace(0.3, 1.2, 1500)
    deepest = np.array(
        [surface_distances_m(shape, candidate(shape)[None], EYE_M + along_m[:, None] * ray)[0].min() for ray in rays]
    )
    clear = np.abs(deepest) > 0.001
    assert clear.sum() > 250
    np.testing.assert_array_equal(found[clear] < 0, deepest[clear] < 0)
    missing = deepest > 0.001
    assert (found[missing] <= deepest[missing] + 5e-4).all()  # a gap, never more than the distance


@pytest.mark.parametrize("shape", SHAPES)
def test_outline_points_lie_on_the_surface(shape):
    points_m = outline_points_m(shape, candidate(shape))
    np.testing.assert_allclose(surface_distances_m(shape, candidate(shape)[None], points_m), 0, atol=1e-9)


def test_candidates_do_not_mix():
    both = np.stack([candidate("box"), candidate("box", 1.9)])
    points_m = np.random.default_rng(2).uniform(-0.1, 0.3, (20, 3))
    together = surface_distances_m("box", both, points_m)
    for k in range(2):
        np.testing.assert_allclose(together[k], surface_distances_m("box", both[k : k + 1], points_m)[0])
