"""LLM backends: text in, text out; one a file or package, each a `base.LanguageModel`, chosen by name in `registry`."""
