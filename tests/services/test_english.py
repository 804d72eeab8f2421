import pytest

from app.services.english import is_english


@pytest.mark.parametrize("word", ["a", "clock", "rug", "plane", "azure", "the", "zucchini", "button"])
def test_english_words(word):
    assert is_english(word)


@pytest.mark.parametrize("word", ["", "yelow", "buton", "zzzz", "über", '"', ":", "clock:", "12"])
def test_other_words_are_not_english(word):
    assert not is_english(word)
