"""The report of an evaluation: a folder that any browser shows without network or scripts."""
