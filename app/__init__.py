"""RoboPrompt as a web service: robot skills that an off-the-shelf LLM learns from a handful of demonstrations."""
