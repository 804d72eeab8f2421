import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.order import space
from app.pipeline.order.space import Layout

ROW = {"a": (0.3, 0.3, 0.8), "b": (0.3, 0.1, 0.8), "c": (0.3, -0.1, 0.8), "d": (0.5, -0.3, 0.8)}
ALL = tuple(ROW)


def layout(**moved):
    places = {**ROW, **moved}
    return Layout({name: np.array(place) for name, place in places.items()}, np.zeros(3))


@pytest.mark.parametrize(
    ("pick", "names", "found"),
    [
        (space.extreme("left"), ALL, ("a",)),
        (space.extreme("right", 2), ALL, ("c",)),
        (space.extreme("left", 5), ALL, ()),
        (space.extreme("far"), ALL, ("d",)),
        (space.extreme("near"), ALL, ("a", "b", "c")),  # equally near: not decided
        (space.by_distance(None), ("a", "d"), ("a",)),
        (space.by_distance(None, farthest=True), ALL, ("d",)),
        (space.by_distance("a"), ALL, ("b",)),
        (space.by_distance("a", 2, farthest=True), ALL, ("c",)),
        (space.next_to("a"), ALL, ("b",)),
        (space.next_to("b"), ALL, ("a", "c", "d")),  # one on either side
        (space.beyond("left", "c"), ALL, ("b",)),
        (space.beyond("left", "a"), ALL, ()),
        (space.beyond("far", "a"), ALL, ()),  # d is farther away, but mostly to the right
        (space.resting_on("a"), ALL, ()),
        (space.between("a", "c"), ALL, ("b",)),
        (space.between("a", "a"), ALL, ()),
        (space.on_side("left"), ("b", "c"), ("b",)),
        (space.on_side("left"), ALL, ("a", "b")),
        (space.on_side("right"), ("a", "b", "d"), ("d",)),
        (space.in_the_middle, ("a", "b", "c"), ("b",)),
        (space.in_the_middle, ALL, ALL),
    ],
)
def test_relations_in_the_robots_frame(pick, names, found):
    assert pick(layout(), names) == found


def test_objects_closer_together_than_poses_are_certain_are_not_distinguished():
    assert space.extreme("left")(layout(b=(0.3, 0.29, 0.8)), ALL) == ("a", "b")


@pytest.mark.parametrize(
    ("place_m", "found"),
    [
        ((0.31, 0.29, 0.81), ("b",)),  # a bowl on a flat box
        ((0.3, 0.15, 1.0), ("b",)),  # on the other end of a cabinet
        ((0.3, 0.22, 0.82), ()),  # beside it
        ((0.3, 0.3, 0.7), ()),  # below it
    ],
)
def test_what_rests_on_an_object_is_above_it_or_at_its_place(place_m, found):
    assert space.resting_on("a")(layout(b=place_m), ALL) == found


def test_what_stands_higher_elsewhere_does_not_rest_on_an_object():
    on_a_cabinet = {"b": (0.3, 0.29, 0.81), "c": (0.3, 0.0, 1.05)}
    assert space.beyond("top", "a")(layout(**on_a_cabinet), ("c",)) == ("c",)
    assert space.resting_on("a")(layout(**on_a_cabinet), ("b", "c")) == ("b",)
    assert space.resting_on("a")(layout(**on_a_cabinet), ("c",)) == ()


def test_distances_are_measured_from_where_the_robot_stands():
    beside = Layout(layout().positions_m, np.array([0.5, -0.5, 0.0]))
    assert space.by_distance(None)(beside, ALL) == ("d",)


@pytest.mark.parametrize("yaw_deg", [-170, -90, 37, 90, 180])
@pytest.mark.parametrize("pick", [space.extreme("left"), space.beyond("far", "a"), space.on_side("right")])
def test_sides_turn_with_the_robot(yaw_deg, pick):
    turn = Rotation.from_euler("z", yaw_deg, degrees=True)
    base_m = np.array([0.2, -0.4, 0.1])
    turned = {name: turn.apply(place) + base_m for name, place in ROW.items()}
    seen = Layout(turned, base_m, np.radians(yaw_deg))
    assert pick(seen, ALL) == pick(layout(), ALL)
