"""Scenes drawn from their poses."""

from app.web.scene import object_colors


def test_an_object_has_the_color_that_its_name_says():
    colors = object_colors(["cup", "red cube", "maroon_jar", "Blue cube", "teal block", "tray"])
    assert colors["red cube"] == object_colors(["red"])["red"]
    assert colors["Blue cube"] == object_colors(["blue"])["blue"]
    assert colors["teal block"] == object_colors(["green"])["green"]
    assert len(set(colors.values())) == 6
    assert list(object_colors(f"thing {k}" for k in range(40))) == [f"thing {k}" for k in range(40)]
