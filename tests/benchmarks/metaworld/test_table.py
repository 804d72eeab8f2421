from benchmarks.metaworld.table import markdown
from tests.benchmarks.metaworld.conftest import LLM


def rows(text):
    lines = [line[1:-1].split("|") for line in text.splitlines() if line.startswith("|")]
    return {first.strip(): [cell.strip() for cell in cells] for first, *cells in lines}


def test_markdown(found):
    text = markdown(found, {"versions": "metaworld 1"})
    table = rows(text)
    assert table["task"] == ["demonstrations", "keyframes", "replay", "nearest", LLM, "LLM, median s"]
    assert table["push"] == ["3", "4-7", "3/3", "2/4, 1 error", "1/2", "3.0"]
    assert table["reach-wall"] == ["1, 2 refused", "3", "1/1", "0/2, 2 errors", "1/1", "8.0"]
    assert table["hammer"] == ["0", "-", "-", "-", "-", "-"]
    assert table["mean"] == ["", "", "100.0%", "25.0%", "75.0%", ""]
    assert "A prediction of the LLM took 3.0 s (median), at most 8.0 s." in text
    assert "- 3 x 422 too far, for example: by 3 m\n- 2 x 422 no\n" in text
    assert text.endswith("- versions: metaworld 1\n")


def test_markdown_without_llm_and_errors(found):
    text = markdown(found[2:], {})
    assert "Errors" not in text
    assert "LLM took" not in text
    assert len({len(line) for line in text.splitlines() if line}) == 1, "columns are of even width"
