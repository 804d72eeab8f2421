import pytest

from app.perception.registered.turns import suggested_symmetry


@pytest.mark.parametrize(
    ("turns", "symmetry"),
    [
        ((183.0,), 180.0),
        ((118.0, 241.0), 120.0),
        ((88.0, 182.0, 275.0), 90.0),
        ((271.0,), 90.0),
        ((30.0, 75.0, 150.0, 200.0, 290.0), "yaw"),
        ((40.0,), None),
    ],
)
def test_turns_suggest_the_least_symmetry_that_explains_them(turns, symmetry):
    assert suggested_symmetry(turns) == symmetry
