"""The program of the process that `llama_process.LlamaProcess` starts: llama.cpp's HTTP server on a loopback port.

A process of its own, because `xllamacpp.Server` holds Python's global lock while it loads a model (no event loop would
turn meanwhile), and because llama.cpp ends its process when an assertion of its own fails.

Standard input: one line of JSON, `LlamaOptions`; the server runs until the input's end, which comes with the parent's.
Standard output: one line of JSON, `{"url": ...}`, as soon as requests are answered. Standard error: why it failed.
"""

import json
import os
import sys
from typing import Any

PROMPT_CACHE_MIB = 1024  # Gemma 3 270M: 18 kB a token, some fifty prompts of ten demonstrations
BATCH_TOKENS = 128  # 0.3 s on two cores; reading takes 2 % longer than with llama.cpp's 2048
DRAFT_TOKENS = 48  # copied from the prompt and tried as a whole


def main() -> None:
    """Serve until standard input ends."""
    options = json.loads(sys.stdin.readline())
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever llama.cpp prints must not be taken for the answer
    server = _start(options)
    answer.write(json.dumps({"url": str(server.listening_address)}) + "\n")
    answer.close()
    _silence()
    sys.stdin.read()
    os._exit(0)  # the operating system frees faster than destructors that wait for running requests


def _start(options: dict[str, Any]) -> Any:  # noqa: ANN401  xllamacpp has no types
    import xllamacpp

    params = xllamacpp.CommonParams()
    params.model.path = options["model"]
    params.api_keys = [options["api_key"]]
    params.n_parallel = options["slots"]
    params.n_ctx = options["context_tokens"] * options["slots"]
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = options["threads"]
    # Keep the whole context of models with a sliding window (Gemma), and prompts that lost their slot in memory. With
    # six tasks taking turns on four slots a query costs 12 prompt tokens instead of 1055; either alone does not do it.
    params.swa_full = True
    params.cache_ram_mib = PROMPT_CACHE_MIB
    # A prompt is read in pieces this small: between two of them other requests go on and an abandoned one is noticed.
    # llama.cpp ends its process unless the next token and the draft of every slot fit into one piece.
    params.n_batch = params.n_ubatch = max(BATCH_TOKENS, options["slots"] * (1 + DRAFT_TOKENS))
    # Replies copy rows of the prompt: what followed the last 12 tokens before is tried as a whole and kept as far as
    # the model agrees. The same replies, two to three times faster.
    params.speculative.types = [xllamacpp.common_speculative_type.COMMON_SPECULATIVE_TYPE_NGRAM_SIMPLE]
    params.speculative.ngram_simple.size_m = DRAFT_TOKENS
    params.verbosity = 1  # errors only
    params.ui = False
    return xllamacpp.Server(params)


def _silence() -> None:
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)


if __name__ == "__main__":
    main()
