"""Numbers as people read them."""

NOTHING = "\N{EN DASH}"


def duration_text(seconds: float | None) -> str:
    """For example ``6.3 ms``, ``1.24 s``, ``2 min 5 s``; a dash for None."""
    if seconds is None:
        return NOTHING
    if seconds < 1:
        return f"{1000 * seconds:.3g} ms"
    if seconds < 100:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def tokens_text(tokens: float | None) -> str:
    """A whole number with thousands set apart; a dash for None."""
    return NOTHING if tokens is None else f"{tokens:,.0f}"


def percent_text(share: float) -> str:
    """A share in [0, 1] as whole percent, without the sign."""
    return f"{100 * share:.0f}"
