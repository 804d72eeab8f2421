"""A yardstick, no LLM: ridge regression of the actions' integers on the observation's integers, from the same prompt.

It reads demonstrations from the prompt's text as an LLM would, knows nothing of objects, frames or rotations, and shows
how much of a task is a linear map. It cannot follow an instruction that no demonstration carries out, nor choose the
number of actions.
"""

from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from app.llm.base import ModelProfile, ModelResponseError
from app.llm.prompt_text import Pair, Pattern, alike, taken_apart

PROFILE = ModelProfile(
    name="regression",
    style="completion",
    grammar=False,
    representation="absolute",
    system_prompt="none",
    description="No LLM: ridge regression on the prompt's integers, a yardstick",
)
MIN_DEMONSTRATIONS = 2
# Weight of the squared coefficients against squared errors in bins. Positions vary over tens of bins, so it decides
# only where the demonstrations leave a coefficient open.
RIDGE = 1.0

Numbers = npt.NDArray[np.float64]


def regressed_reply(prefix: str, query: str) -> str:
    """The actions for `query`, in the form that the demonstrations in `prefix` have.

    Raises:
        ModelResponseError: if `prefix` is not a row of demonstrations, or has too few that are like the query.
    """
    shown, observation = taken_apart(prefix, query)
    pairs = _of_one_form(shown, observation)
    inputs = np.array([seen.integers for seen, _ in pairs], dtype=np.float64)
    written = [actions.integers for _, actions in pairs]
    outputs = np.array(written, dtype=np.float64)
    predicted = _ridge(inputs, outputs, np.array(observation.integers, dtype=np.float64))
    columns = list(zip(*written, strict=True))
    signs = {integer[0] for column in columns for integer in column} & {"+", "-"}
    return pairs[-1][1].filled([_as_written(*item, signs) for item in zip(predicted, columns, strict=True)])


def _of_one_form(pairs: Sequence[Pair], observation: Pattern) -> list[Pair]:
    """The demonstrations that are like the query, and of these the ones whose actions have the most frequent form."""
    same = alike(pairs, observation, MIN_DEMONSTRATIONS)
    forms = Counter(actions.template for _, actions in same)
    chosen = [pair for pair in same if pair[1].template == forms.most_common(1)[0][0]]
    if len(chosen) < MIN_DEMONSTRATIONS:
        raise ModelResponseError(
            f"regression found {len(chosen)} of {len(pairs)} demonstrations that are like the query; it needs"
            f" {MIN_DEMONSTRATIONS}"
        )
    return chosen


def _ridge(inputs: Numbers, outputs: Numbers, query: Numbers) -> Numbers:
    """The outputs at `query`.

    Args:
        inputs: (N, D).
        outputs: (N, K).
        query: (D,).

    Returns:
        (K,).
    """
    input_mean, output_mean = inputs.mean(axis=0), outputs.mean(axis=0)
    centred = inputs - input_mean
    gram = centred.T @ centred + RIDGE * np.eye(len(query))
    coefficients = np.linalg.solve(gram, centred.T @ (outputs - output_mean))
    predicted: Numbers = output_mean + (query - input_mean) @ coefficients
    return predicted


def _as_written(value: float, column: Sequence[str], signs: Collection[str]) -> str:
    """`value` as an integer, one of two choices (a gripper) or any, with those signs that the demonstrations use."""
    choices = sorted({int(written) for written in column})
    integer = min(choices, key=lambda choice: abs(choice - value)) if len(choices) <= 2 else round(value)
    if "+" in signs and column[0][0] in "+-":
        return f"{integer:+d}"
    return str(integer if "-" in signs else max(integer, 0))
