"""Any server that speaks OpenAI's HTTP API: OpenAI, vLLM, SGLang, Ollama, llama.cpp, OpenRouter."""

from functools import partial

from app.llm.base import Completion, CompletionRequest, ModelProfile
from app.llm.openai_wire import Quirks, parse_event, quirks_of, request_body, request_path
from app.llm.sse import SseEndpoint
from app.llm.streaming import Pieces, assembled, whole_within_deadline, within_deadline


class OpenAiCompatibleModel:
    """One model of one server.

    Args:
        base_url: up to and including the version, e.g. ``http://127.0.0.1:11434/v1``.
        model: the server's name of the model.
        api_key: empty for a server that asks for none.
        key_variable, url_variable: what to set when the server refuses the key or cannot be reached, for messages.
        quirks: how the server differs; by its host if None.
        trust_env: whether proxies named in the environment are used.
    """

    def __init__(
        self,
        profile: ModelProfile,
        base_url: str,
        model: str,
        api_key: str = "",
        *,
        key_variable: str = "",
        url_variable: str = "",
        quirks: Quirks | None = None,
        trust_env: bool = True,
    ) -> None:
        self._profile = profile
        self._write = partial(
            request_body,
            model=model,
            style=profile.style,
            quirks=quirks_of(base_url) if quirks is None else quirks,
        )
        self._endpoint = SseEndpoint(
            profile.name,
            f"{base_url.rstrip('/')}/{request_path(profile.style)}",
            {"Authorization": f"Bearer {api_key}"} if api_key else {},
            api_key,
            key_variable=key_variable,
            url_variable=url_variable,
            trust_env=trust_env,
        )

    @property
    def profile(self) -> ModelProfile:
        return self._profile

    def stream(self, request: CompletionRequest) -> Pieces:
        return within_deadline(self._pieces(request), request.timeout_s, self._profile.name)

    async def complete(self, request: CompletionRequest) -> Completion:
        return await whole_within_deadline(self._pieces(request), request.timeout_s, self._profile.name)

    async def aclose(self) -> None:
        await self._endpoint.aclose()

    def _pieces(self, request: CompletionRequest) -> Pieces:
        chunks = self._endpoint.chunks(self._write(request), parse_event)
        return assembled(chunks, request.prompt.stop, self._profile.name)
