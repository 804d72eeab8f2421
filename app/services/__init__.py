"""Use cases, one verb a file: what the service does, without knowing the web."""
