"""Which words are English: what tells a misspelling from another word."""

import gzip
from functools import lru_cache
from importlib.resources import files


@lru_cache(maxsize=4096)
def is_english(word: str) -> bool:
    """Whether pyspellchecker's frequency list (from film subtitles, 160,000 words) has the word in lower case."""
    return f'"{word}":'.encode() in _frequency_list()


@lru_cache(maxsize=1)
def _frequency_list() -> bytes:
    """The list as JSON text: 2.5 MB, where as a set of words it would take 20."""
    return gzip.decompress((files("spellchecker") / "resources" / "en.json.gz").read_bytes())
