"""Demonstrations by hand: an arm is sampled, and what was recorded waits on disk until the service has it."""
