"""How well a configuration does: demonstrations recorded, scenes predicted over HTTP, executed, judged and reported."""
