import numpy as np
import pytest

from app.perception.registered.scene import find_table

SHARE_OF_TABLE, NUM_POINTS = 0.18, 20_000


def level(random, height_m, share, size_m):
    """Points of a level surface with a depth camera's noise."""
    count = int(share * NUM_POINTS)
    return np.column_stack([random.uniform(-size_m, size_m, (count, 2)), random.normal(height_m, 0.0015, count)])


def sloping(random, share):
    """Points of walls and slopes around the table."""
    places_m = random.uniform(-1, 1, (int(share * NUM_POINTS), 2))
    return np.column_stack([places_m, 0.9 * places_m[:, 0] + random.uniform(-0.4, 0.4, len(places_m))])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("floor", [0.0, 0.3])
def test_a_table_is_found_though_it_fills_a_fifth_of_the_images_and_the_floor_more(seed, floor):
    random = np.random.default_rng(seed)
    points_m = np.concatenate(
        [
            level(random, 0.8, SHARE_OF_TABLE, 0.4),
            level(random, 0.0, floor, 2.0),
            sloping(random, 1 - SHARE_OF_TABLE - floor),
        ]
    )
    table = find_table(points_m, np.zeros_like(points_m))
    assert table is not None
    assert table.level_m(np.zeros(2)) == pytest.approx(0.8, abs=0.002)


def test_the_top_of_a_box_on_the_table_is_not_the_table():
    random = np.random.default_rng(0)
    surfaces = [(0.0, 0.6), (0.4, 0.2), (0.2, 0.2)]
    points_m = np.concatenate([level(random, height_m, share, 0.4) for height_m, share in surfaces])
    table = find_table(points_m, np.zeros_like(points_m))
    assert table is not None
    assert table.level_m(np.zeros(2)) == pytest.approx(0.0, abs=0.002)
