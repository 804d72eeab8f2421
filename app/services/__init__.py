"""Use cases, one a file: what the service does, without knowing the web."""
