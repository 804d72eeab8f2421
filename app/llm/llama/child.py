"""The program of the process that `process.LlamaProcess` starts: llama.cpp's HTTP server on a loopback port.

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
DRAFT_TOKENS = 16  # copied from the prompt and tried as a whole; of 48 too many are refused, and the first action waits
# Read by llama.cpp. Its tiled product of K-quants takes batches of eight tokens and more, and rounds differently.
ONE_ARITHMETIC = {"GGML_CPU_TILED_MM": "0"}


def main() -> None:
    """Serve until standard input ends."""
    options = json.loads(sys.stdin.readline())
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever llama.cpp prints must not be taken for the answer
    os.environ.update(ONE_ARITHMETIC)
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
    _compute_each_token_alike(params, xllamacpp)
    params.verbosity = 1  # errors only
    params.ui = False
    return xllamacpp.Server(params)


def _compute_each_token_alike(params: Any, xllamacpp: Any) -> None:  # noqa: ANN401
    """Compute each token in the same way, whatever else is in its batch.

    With llama.cpp's defaults the kernels that multiply and attend change with the number of tokens in a batch. A
    prompt's logits then depend on how much of it was cached, on drafts and on other requests: by up to 0.8, enough to
    turn a digit of the reply. What is chosen here is computed token by token in one order; `ONE_ARITHMETIC` belongs
    to it. It holds for quantized weights; those of 16 or 32 bits are multiplied by kernels that differ for one token.
    """
    params.no_extra_bufts = True  # repacked weights are multiplied differently for one token and for four
    params.flash_attn_type = xllamacpp.llama_flash_attn_type.LLAMA_FLASH_ATTN_TYPE_ENABLED
    # Keys of 16 or 32 bits would be attended in tiles for 64 tokens, and in one part per thread for one token.
    params.cache_type_k = xllamacpp.ggml_type.GGML_TYPE_Q8_0
    # Sums of values of type F16 would be rounded to 16 bits. Those of type F32 take a third longer to decode: they are
    # fetched from memory again for every token.
    params.cache_type_v = xllamacpp.ggml_type.GGML_TYPE_BF16


def _silence() -> None:
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)


if __name__ == "__main__":
    main()
