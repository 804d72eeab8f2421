"""A dictionary of English, which distinguishes misspelled words from words with a meaning of their own."""

import gzip
from functools import lru_cache
from importlib.resources import files


def is_english(word: str) -> bool:
    """Whether pyspellchecker's frequency list (160,000 words, from film subtitles) has the word in lower case."""
    listed, wanted = _frequency_list(), f'"{word}"'.encode()
    low, high = 0, len(listed)
    while low < high:
        middle = listed.rfind(b"\n", low, (low + high) // 2) + 1 or low
        end = listed.find(b":", middle, high)
        found = listed[middle:end]
        if end < 0 or found == wanted:
            return end >= 0
        if found < wanted:
            low = listed.find(b"\n", end, high) + 1 or high
        else:
            high = middle
    return False


@lru_cache(maxsize=1)
def _frequency_list() -> bytes:
    """The list's lines `"word": number`, in the order of their bytes: 3 MB, where a set of words would take 20."""
    text = gzip.decompress((files("spellchecker") / "resources" / "en.json.gz").read_bytes())
    return text.strip(b"{}\n")
