"""What a model only considered before it answered: the delimiters by which models set it apart in their text.

A chat template may open the reasoning in the prompt, so that only its end stands in the reply. Whatever comes before an
end is therefore reasoning, whether its begin is seen or not.
"""

import re

# Begin and end, as the models' chat templates and cards have them.
DELIMITERS = (
    ("<think>", "</think>"),  # DeepSeek-R1, Qwen3, QwQ, GLM, MiniMax, Phi-4, Hunyuan
    ("<thinking>", "</thinking>"),  # Claude where it is asked to
    ("<thought>", "</thought>"),  # EXAONE Deep, Gemini's compatible API
    ("<reasoning>", "</reasoning>"),
    ("<reflection>", "</reflection>"),
    ("<analysis>", "</analysis>"),
    ("<scratchpad>", "</scratchpad>"),
    ("<seed:think>", "</seed:think>"),  # Seed-OSS
    ("<longcat_think>", "</longcat_think>"),  # LongCat
    ("[THINK]", "[/THINK]"),  # Magistral
    ("◁think▷", "◁/think▷"),  # Kimi-VL
    ("<|START_THINKING|>", "<|END_THINKING|>"),  # Command A
    ("<|begin_of_thought|>", "<|end_of_thought|>"),  # OpenThinker
    ("<|inner_prefix|>", "<|inner_suffix|>"),  # Apertus
    ("<|channel|>analysis", "<|channel|>final<|message|>"),  # gpt-oss
    ("<|channel|>commentary", "assistantfinal"),  # the same, and its end where special tokens are not written
    ("<|channel>thought", "<channel|>"),  # Gemma 4
    ("<unused94>", "<unused95>"),  # MedGemma
)


def _any_of(texts: tuple[str, ...]) -> re.Pattern[str]:
    return re.compile("|".join(map(re.escape, texts)), re.IGNORECASE)


_BEGINS, _ENDS = map(_any_of, zip(*DELIMITERS, strict=True))
DELIMITER = re.compile(f"{_BEGINS.pattern}|{_ENDS.pattern}", re.IGNORECASE)
ALL_DELIMITERS = frozenset(mark.lower() for pair in DELIMITERS for mark in pair)


def after_reasoning(text: str) -> tuple[str, str]:
    """Return what follows the last end of reasoning, and the delimiter that begins reasoning in it; empty for none."""
    ends = list(_ENDS.finditer(text))
    answer = text[ends[-1].end() :] if ends else text
    begun = _BEGINS.search(answer)
    return answer, begun.group() if begun else ""
