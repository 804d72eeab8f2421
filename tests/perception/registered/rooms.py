"""Templates and scenes for these tests: small images, taught once."""

from functools import cache

import numpy as np

from app.perception.registered.estimator import RegisteredPoses, TaughtQuery
from app.perception.registered.learn import LabeledView, learn
from app.perception.registered.model import RegisteredModel
from synthetic.object_scenes import Layout, Room, upright
from synthetic.object_shapes import THINGS

NAMES = ("carton", "jar", "brick", "mug")
ROOM = Room(names=(*NAMES, "bowl", "drawer"))
PLACES = ((0.0, 0.05, 0.3), (0.1, -0.05, 1.6), (-0.1, 0.0, -1.1))


def layout(**places):
    """Objects by name at (x, y, yaw); `carton_2` is a second carton."""
    numbered = ((name.removesuffix("_2"), int(name.endswith("_2")), place) for name, place in places.items())
    return Layout({(name, number): upright(*place) for name, number, place in numbered})


def frames(where, seed=0, **more):
    return ROOM.frames(where, np.random.default_rng(seed), **more)


@cache
def view(name, number):
    """A labeled view of the object alone."""
    return LabeledView(frames(layout(**{name: PLACES[number]}), number, of=(name, 0)))


@cache
def taught(name, num_views=2):
    return learn(name, [view(name, number) for number in range(num_views)], THINGS[name].symmetry_deg)


def query(name, **model):
    symmetry_deg = THINGS[name].symmetry_deg
    symmetric = "none" if symmetry_deg is None else "yaw" if symmetry_deg == 0 else symmetry_deg
    fields = {"symmetric": symmetric, **model}
    return TaughtQuery(name, model=RegisteredModel("0" * 64, **fields), template=taught(name).template)


def estimate(name, where, seed=0, num=3, **model):
    (pose,) = RegisteredPoses().estimate([query(name, **model)], frames(where, seed, num=num))
    return pose
