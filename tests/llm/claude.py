"""What Anthropic's servers send, as its documentation ("Streaming Messages") shows it."""

from app.llm.anthropic import AnthropicModel
from app.llm.base import ModelProfile
from app.llm.sse import Server

KEY = "sk-ant-very-secret"


def claude_at(base_url, model="claude-haiku-5-5", key=KEY):
    profile = ModelProfile(f"anthropic/{model}", "chat", grammar=False, representation="absolute")
    server = Server(base_url, key, "ROBOPROMPT_ANTHROPIC_API_KEY", "ROBOPROMPT_ANTHROPIC_BASE_URL")
    return AnthropicModel(profile, server, model)


def started(input_tokens=25, read=0, written=0):
    usage = {"input_tokens": input_tokens, "output_tokens": 1}
    usage |= {"cache_read_input_tokens": read, "cache_creation_input_tokens": written}
    message = {"id": "msg_1", "type": "message", "role": "assistant", "content": [], "model": "claude", "usage": usage}
    return {"type": "message_start", "message": message | {"stop_reason": None, "stop_sequence": None}}


def said(text, index=0):
    return {"type": "content_block_delta", "index": index, "delta": {"type": "text_delta", "text": text}}


def thought(text):
    return {"type": "content_block_delta", "index": 0, "delta": {"type": "thinking_delta", "thinking": text}}


def ended(stop_reason="end_turn", output_tokens=15):
    delta = {"stop_reason": stop_reason, "stop_sequence": None}
    return {"type": "message_delta", "delta": delta, "usage": {"output_tokens": output_tokens}}


BLOCK = {"type": "content_block_start", "index": 0, "content_block": {"type": "text", "text": ""}}
PING = {"type": "ping"}
STOP = {"type": "message_stop"}


def failed(kind, message):
    return {"type": "error", "error": {"type": kind, "message": message}}
