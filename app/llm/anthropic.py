"""Anthropic's Claude models through the Messages API."""

from app.llm.anthropic_wire import EventParser, request_body, request_headers
from app.llm.base import Completion, CompletionRequest, ModelProfile
from app.llm.sse import SseEndpoint
from app.llm.streaming import Pieces, assembled, whole_within_deadline, within_deadline


class AnthropicModel:
    """One Claude model.

    Args:
        base_url: up to and including the version, e.g. ``https://api.anthropic.com/v1``.
        model: Anthropic's name of the model.
        key_variable, url_variable: what to set when the server refuses the key or cannot be reached, for messages.
    """

    def __init__(
        self,
        profile: ModelProfile,
        base_url: str,
        model: str,
        api_key: str,
        *,
        key_variable: str = "",
        url_variable: str = "",
    ) -> None:
        self._profile = profile
        self._model = model
        self._endpoint = SseEndpoint(
            profile.name,
            f"{base_url.rstrip('/')}/messages",
            request_headers(model, api_key),
            api_key,
            key_variable=key_variable,
            url_variable=url_variable,
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
        chunks = self._endpoint.chunks(request_body(request, self._model), EventParser())
        return assembled(chunks, request.prompt.stop, self._profile.name)
