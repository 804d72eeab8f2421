import pytest

from app.pipeline.order.similarity import Described, most_similar, similarity

CLOSE_JAR = Described("close the red jar", ("lid", "red jar"))
CLOSE_LAPTOP = Described("close the laptop", ("laptop",))
STACK_CUBE = Described("stack the blue cube on the yellow cube", ("blue cube", "yellow cube"))
PUT_CUBE = Described("put the cube in the shape sorter", ("cube", "shape sorter"))
PUSH_RED = Described("push the red button", ("red button", "blue button"))
PUSH_BLUE = Described("push the blue button", ("red button", "blue button"))


def test_the_verb_counts_though_it_may_be_a_preposition_elsewhere():
    assert similarity(CLOSE_JAR, CLOSE_LAPTOP) == pytest.approx(1 / 3)  # close, jar, laptop


def test_verbs_of_a_family_are_one():
    assert similarity(STACK_CUBE, PUT_CUBE) == pytest.approx(2 / 4 + 1 / 3)


def test_colors_say_which_object_and_not_what_is_done():
    assert similarity(PUSH_RED, PUSH_BLUE) == 2
    assert similarity(CLOSE_JAR, PUSH_RED) == 0


def test_a_name_that_has_a_verb_in_it_is_no_verb():
    assert similarity(Described("turn left tap", ("left tap",)), PUSH_RED) == 0


def test_the_most_similar_stands_last_and_the_unrelated_are_left_out():
    tasks = [("close_laptop", CLOSE_LAPTOP), ("push", PUSH_RED), ("put", PUT_CUBE)]
    assert most_similar(STACK_CUBE, tasks) == ("put",)
    assert most_similar(CLOSE_JAR, [*tasks, ("again", CLOSE_JAR)]) == ("close_laptop", "again")
    assert most_similar(CLOSE_JAR, [*tasks, ("again", CLOSE_JAR)], 1) == ("again",)


def test_where_nothing_is_related_the_number_of_objects_decides_then_the_name():
    tasks = [("c", CLOSE_LAPTOP), ("b", STACK_CUBE), ("a", PUT_CUBE)]
    assert most_similar(PUSH_RED, tasks, 2) == ("b", "a")
    assert most_similar(PUSH_RED, tasks[::-1], 2) == ("b", "a")


def test_nothing_to_choose_from():
    assert most_similar(PUSH_RED, []) == ()
    assert similarity(Described("the", ()), Described("the", ())) == 0
