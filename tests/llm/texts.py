"""Prompts of the two formats that the service writes, small enough for seconds on a busy machine."""

import random

from app.llm.base import CompletionRequest
from app.llm.resilient import NO_LIMITS, Places, ResilientModel
from app.pipeline.prompt import Prompt

GRAMMAR = """root ::= " 1 " ("red cube" | "blue cube") " w: " d " " d " " d " " r " " r " " r " " [01] "\n"
d ::= [+-] [0-9]+
r ::= [0-9] [0-9]?
"""
ENDLESS = 'root ::= "a " root'
REPLY = " 1 red cube w: +0 +0 +20 0 36 36 1"


def object_frame_prompt(seed=0, query_seed=0, num_demonstrations=2, grammar=GRAMMAR):
    """Move above the cube that the instruction names."""
    rng = random.Random(seed)
    prefix = "".join(_demonstration(rng) for _ in range(num_demonstrations))
    query = _observation(random.Random(1000 + query_seed), "red")
    return Prompt("", prefix, query, ("\n",), grammar)


def _demonstration(rng):
    color = rng.choice(["red", "blue"])
    return f"{_observation(rng, color)} 1 {color} cube w: +0 +0 +20 0 36 36 1\n"


def _observation(rng, color):
    cubes = "; ".join(f"{name} cube {rng.randint(10, 90)} {rng.randint(10, 90)} 16" for name in ("red", "blue"))
    return f"{cubes}; lift the {color} cube >"


def absolute_prompt(num_demonstrations=4):
    """The paper's format: 10 bins above the block, then on it."""
    rng = random.Random(0)
    prefix = ""
    for _ in range(num_demonstrations):
        x, y = rng.randint(10, 90), rng.randint(10, 90)
        prefix += f"{{'block': [{x}, {y}, 16], 'lift the block'}}>"
        prefix += f"[[{x}, {y}, 26, 0, 39, 0, 1], [{x}, {y}, 17, 0, 39, 0, 0]], "
    return Prompt("You are a robot.", prefix, "{'block': [44, 55, 16], 'lift the block'}>", ("{'",))


def asking(prompt, **options):
    return CompletionRequest(prompt, **{"timeout_s": 120.0, "max_tokens": 60, **options})


def as_asked(model):
    """The model as requests reach it, within the one deadline."""
    return ResilientModel(model, Places("some", NO_LIMITS))
