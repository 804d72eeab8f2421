import pytest

from app.pipeline.errors import ObjectSetError
from app.pipeline.names import check_aliases_of, check_object_names, checked_aliases, folded_name, spelling_variants
from app.pipeline.order.words import tokens_of
from app.services.task_settings import TaskSettings
from roboprompt_client.errors import InvalidInputError

ONE_NAME = [("red cube", "Red cube"), ("part 1", "part_1"), ("part-1", "part 1"), ("part 1", "part \uff11")]
ONE_NAME += [("caf\u00e9", "cafe\u0301"), ("STRASSE", "stra\u00dfe"), ("red  cube", "red_ cube"), ("a_-b", "a b")]


@pytest.mark.parametrize(("one", "other"), ONE_NAME)
def test_spellings_of_one_name_are_folded_into_one(one, other):
    assert folded_name(one) == folded_name(other)
    assert spelling_variants(["bowl", one, other]) == [(one, other)]


@pytest.mark.parametrize(("one", "other"), [("part 1", "part 2"), ("part1", "part 1"), ("red cube", "blue cube")])
def test_other_names_stay_two(one, other):
    assert not spelling_variants([one, other, one])


@pytest.mark.parametrize(("one", "other"), ONE_NAME[:4])
def test_two_objects_of_one_name_are_refused_with_both(one, other):
    with pytest.raises(ObjectSetError, match=f"one name: {one} and {other}"):
        check_object_names([one, other], [one, other])


def test_a_known_object_in_another_spelling_is_refused_with_the_right_one():
    with pytest.raises(ObjectSetError, match=r"not of this task: Red_Cube \(here: red cube\)"):
        check_object_names(["Red_Cube"], ["red cube"])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["lid"], "missing: jar"),
        ([], "missing: lid, jar"),
        (["lid", "jar", "cup", "pan"], "not of this task: cup, pan"),
        (["lid", "lid", "jar"], "given twice: lid (name them 'lid 1', 'lid 2')"),
        (["lid", "Jar"], "missing: jar; not of this task: Jar (here: jar)"),
        (["cup", "cup", "lid"], "missing: jar; not of this task: cup; given twice: cup (name them 'cup 1', 'cup 2')"),
    ],
)
def test_another_set_of_objects_is_refused_by_its_differences(given, message):
    with pytest.raises(ObjectSetError) as caught:
        check_object_names(given, ["lid", "jar"])
    assert (caught.value.field, caught.value.message, caught.value.valid) == ("objects", message, "lid, jar")


@pytest.mark.parametrize("text", ["Part_1", "part-1", "PART \uff11", "part 1", "\uff30art 1"])
def test_instructions_are_read_alike_in_every_spelling(text):
    assert [token.text for token in tokens_of(text)] == ["part", "1"]


def test_a_letter_that_grows_in_lower_case_leaves_the_others_readable():
    assert [token.text for token in tokens_of("Put \u0130 ON the Left-Most Plate")][2:] == [
        "on", "the", "leftmost", "plate"
    ]  # fmt: skip


@pytest.mark.parametrize(
    "alias",
    ["blue", "Blue", "cube", "blue_cube", "BLUE  cube", "blue cubes", "Cubes", "azure", "the teal one", "dark navy"],
)
def test_an_alias_is_no_word_of_another_objects_name(alias):
    with pytest.raises(InvalidInputError, match="may also mean 'blue cube'") as caught:
        check_aliases_of({"red cube": [alias]}, ["red cube", "blue cube"])
    assert caught.value.field == "aliases[red cube]"


@pytest.mark.parametrize("words", [("mug", "mugs"), ("mugs", "mug"), ("box", "boxes"), ("berry", "berries")])
def test_two_objects_do_not_share_an_alias_in_singular_and_plural(words):
    with pytest.raises(InvalidInputError, match="stands for 'one' already"):
        checked_aliases({"one": [words[0]], "two": [words[1]]})
    assert checked_aliases({"one": list(words)}) == {"one": words}


@pytest.mark.parametrize("alias", ["the", "other", "the other one", "it", "nearest", "both", "not", "on"])
def test_an_alias_has_a_word_that_says_what_is_meant(alias):
    with pytest.raises(InvalidInputError, match="names nothing by itself"):
        check_aliases_of({"red cube": [alias]}, ["red cube", "blue cube"])


@pytest.mark.parametrize(
    "alias", ["red", "dice", "blueberry", "the blue dice", "red one", "crimson", "azure dice", "left"]
)
def test_an_alias_may_be_a_word_of_its_own_object_or_of_none(alias):
    check_aliases_of({"red cube": [alias]}, ["red cube", "blue cube"])


@pytest.mark.parametrize(
    "settings",
    [
        {"aliases": {"red cube": ["a"], "Red_cube": ["b"]}},
        {"yaw_symmetry_deg": {"part 1": 90, "part-1": 180}},
        {"aliases": {"red cube": ["a"]}, "yaw_symmetry_deg": {"Red cube": 90}},
    ],
)
def test_settings_name_each_object_in_one_spelling(settings):
    with pytest.raises(ValueError, match=r"are one name|stands for"):
        TaskSettings(**settings)


def test_settings_name_objects_as_the_task_does():
    settings = TaskSettings(yaw_symmetry_deg={"Red cube": 90})
    with pytest.raises(InvalidInputError, match="is 'red cube' in another spelling"):
        settings.check_models(["red cube", "bowl"])
    with pytest.raises(InvalidInputError, match="is no object of the task"):
        TaskSettings(yaw_symmetry_deg={"red cupe": 90}).check_models(["red cube", "bowl"])
