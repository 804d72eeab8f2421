"""One sentence about what several tasks do, as their steps."""
