"""Observation and instruction -> actions: a question is asked, written for the LLM, answered, and kept."""
