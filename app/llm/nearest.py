"""A yardstick, no LLM: the actions of the demonstration in the prompt whose observation is nearest, word for word.

Beside it one sees what an LLM adds to a representation: with `object_frame` a demonstration's rows are right for
another scene as far as they are relative to the right objects.
"""

import numpy as np

from app.llm.base import ModelProfile, ModelResponseError
from app.llm.prompt_text import Pair, alike, taken_apart

PROFILE = ModelProfile(
    name="nearest",
    style="completion",
    grammar=False,
    representation="object_frame",
    system_prompt="none",
    description="No LLM: copies the actions of the nearest demonstration, a yardstick",
)


def copied_reply(prefix: str, query: str) -> str:
    """The actions of the demonstration whose integers are nearest to those of `query`; of equals the last.

    Raises:
        ModelResponseError: if `prefix` is not a row of demonstrations, or none is like the query.
    """
    shown, observation = taken_apart(prefix, query)
    place = np.array(observation.integers, dtype=np.float64)
    pairs = alike(shown, observation, at_least=1)
    if not pairs:
        raise ModelResponseError("nearest found no demonstration with as many numbers as the query")

    def distance(pair: Pair) -> float:
        return float(np.linalg.norm(np.array(pair[0].integers, dtype=np.float64) - place))

    _, actions = min(reversed(pairs), key=distance)
    return actions.filled(actions.integers)
