"""Bounds of motion (`limits`) and the check of actions against them (`guard`), which service and robot both run."""
