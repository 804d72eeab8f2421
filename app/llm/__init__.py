"""LLM backends: text in, text out. One backend a file, one Protocol (`base.LanguageModel`), chosen by name in `registry`."""
