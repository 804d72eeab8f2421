"""A real HTTP server on a loopback port that answers what a test tells it to, byte for byte."""

import asyncio
import json
from contextlib import asynccontextmanager, suppress

SSE_HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nTransfer-Encoding: chunked\r\n\r\n"


class Loopback:
    """Answers each request with `answer(self, writer)`.

    Attributes:
        requests: (head, body) of each request so far.
        gone: set when a client closes the connection before its answer is complete.
        num_gone: of such clients.
    """

    def __init__(self, answer):
        self.answer = answer
        self.requests = []
        self.gone = asyncio.Event()
        self.num_gone = 0

    async def _serve(self, reader, writer):
        try:
            await self._receive(reader)
            leaving = asyncio.create_task(self._notice_leaving(reader))
            await self.answer(writer)
            leaving.cancel()
        except (ConnectionError, asyncio.IncompleteReadError):
            self.gone.set()
        finally:
            writer.close()

    async def _receive(self, reader):
        head = (await reader.readuntil(b"\r\n\r\n")).decode()
        length = next(int(line.split(":")[1]) for line in head.splitlines() if line.lower().startswith("content-l"))
        self.requests.append((head, json.loads(await reader.readexactly(length))))

    async def _notice_leaving(self, reader):
        with suppress(ConnectionError):
            if await reader.read(1):
                return
        self.num_gone += 1
        self.gone.set()


@asynccontextmanager
async def loopback(answer):
    """Yields (base URL, Loopback)."""
    server = Loopback(answer)
    async with await asyncio.start_server(server._serve, "127.0.0.1", 0) as listening:
        port = listening.sockets[0].getsockname()[1]
        yield f"http://127.0.0.1:{port}/v1", server


def status(code, body=b"", **headers):
    """An answer that is not a stream.

    Args:
        headers: further ones, with `_` for `-`.
    """
    headers = {"Content-Type": "application/json", "Content-Length": len(body), **headers}
    head = "".join(f"{name.replace('_', '-')}: {value}\r\n" for name, value in headers.items())

    async def answer(writer):
        writer.write(f"HTTP/1.1 {code} Said\r\n{head}\r\n".encode() + body)
        await writer.drain()

    return answer


def in_turn(*answers):
    """One answer after the other; the last from then on."""
    turns = list(answers)

    async def answer(writer):
        await (turns.pop(0) if len(turns) > 1 else turns[0])(writer)

    return answer


def after(delay_s, answer):
    """An answer whose first byte is late."""

    async def late(writer):
        await asyncio.sleep(delay_s)
        await answer(writer)

    return late


async def hang_up(writer):
    """No answer at all."""
    writer.transport.abort()


def chunk(data):
    return f"{len(data):x}\r\n".encode() + data + b"\r\n"


def event(value):
    data = value if isinstance(value, str) else json.dumps(value)
    return chunk(f"data: {data}\n\n".encode())


END = chunk(b"")


def streamed(*events, delay_s=0.0, end=END):
    """An answer that streams events."""

    async def answer(writer):
        writer.write(SSE_HEAD)
        for value in events:
            writer.write(event(value))
            await writer.drain()
            await asyncio.sleep(delay_s)
        writer.write(end)
        await writer.drain()

    return answer


def text(piece, finish_reason=None):
    return {"choices": [{"text": piece, "finish_reason": finish_reason}]}


def delta(piece, finish_reason=None):
    return {"choices": [{"delta": {"content": piece}, "finish_reason": finish_reason}]}


def usage(prompt_tokens, cached_tokens, completion_tokens):
    details = {"prompt_tokens_details": {"cached_tokens": cached_tokens}}
    counts = {"prompt_tokens": prompt_tokens, "completion_tokens": completion_tokens}
    return {"choices": [], "usage": counts | details}
