"""LLM backends: text in, text out; one a file, all of them a `base.LanguageModel`, chosen by name in `registry`."""
