"""Push buttons one after the other in the order that the instruction tells; demonstrated with single presses only."""

from itertools import chain, product

import numpy as np

from app.sim.tasks.buttons import COLOURS, ButtonTask

MAX_PRESSES = 6  # paper, appendix "Real robots experiments"
# Variation k asks for the k-th: first the single presses, then all pairs, ...
SEQUENCES = tuple(chain.from_iterable(product(COLOURS, repeat=length) for length in range(1, MAX_PRESSES + 1)))
TEST_STREAM = 1  # keeps the draw of a test's sequence apart from that of the same seed's scene


class PushMultipleButtons(ButtonTask):
    """The scene of `push_button`. Demonstrations press one button; tests ask for 1 to 6 presses, colours repeating.

    As in the paper, a test's number of presses is uniform in 1..6 and each colour is drawn at random. Success: the
    buttons have been pressed in exactly the order asked for, with no other press.
    """

    name = "push_multiple_buttons"
    test_only_variations = len(SEQUENCES) - len(COLOURS)

    @classmethod
    def test_variation(cls, seed: int) -> int:
        random = np.random.default_rng((TEST_STREAM, seed))
        colours = random.choice(COLOURS, random.integers(1, MAX_PRESSES, endpoint=True))
        return SEQUENCES.index(tuple(colours.tolist()))

    @property
    def asked(self) -> tuple[str, ...]:
        return SEQUENCES[self.variation]

    def succeeded(self) -> bool:
        return self.events == list(self.asked)
