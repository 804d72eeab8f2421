"""An OpenAI-compatible server that answers with the rows of the nearest demonstration, or as a test says."""

import json
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from app.llm.computed import copied_reply

CHARACTERS = 2  # a token


def reply_to(prompt):
    """Of the nearest demonstration."""
    begin = prompt.rindex("{")
    return copied_reply(prompt[:begin], prompt[begin:])


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_POST(self):
        asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.asked.append((self.headers.get("Authorization"), asked))
        texts = [message["content"] for message in asked["messages"]]
        reply = self.server.reply_to(texts[-1])
        usage = {"prompt_tokens": len("".join(texts)) // CHARACTERS, "completion_tokens": len(reply) // CHARACTERS}
        events = [
            {"choices": [{"delta": {"content": reply}, "finish_reason": None}]},
            {"choices": [{"delta": {}, "finish_reason": "stop"}]},
            {"choices": [], "usage": usage},
        ]
        lines = [f"data: {json.dumps(event)}\n\n" for event in events]
        body = "".join([*lines, "data: [DONE]\n\n"]).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *arguments):
        """Nothing to say."""


@contextmanager
def copying_llm(reply_to=reply_to):
    """Yields the server's base URL and the list of (header Authorization, body) that it was asked with.

    Args:
        reply_to: the reply to a prompt's last message.
    """
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.asked, server.reply_to = [], reply_to
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/v1", server.asked
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
