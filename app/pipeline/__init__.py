"""The method of RoboPrompt (arXiv 2410.12782): pure functions on frozen dataclasses.

No I/O, no clock, no global state.
"""
