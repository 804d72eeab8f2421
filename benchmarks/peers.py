"""How other policy servers take an observation: each with a policy that returns a constant.

`openvla`: as OpenVLA's `vla-scripts/deploy.py`, JSON by POST with arrays in base64 (json_numpy). `openpi`: as openpi's
`websocket_policy_server.py`, MessagePack with raw arrays over a websocket. Run:
``python -m benchmarks.peers openvla|openpi --port PORT``.
"""

import argparse
import asyncio
import http
from typing import Any

import json_numpy
import msgpack
import numpy as np
import uvicorn
from fastapi import FastAPI, Request, Response
from websockets.asyncio.server import Request as Handshake
from websockets.asyncio.server import Response as HandshakeAnswer
from websockets.asyncio.server import ServerConnection, serve

ACTION = np.zeros(7)


def openvla_app() -> FastAPI:
    """POST /act; the image must have arrived as an array."""
    app = FastAPI()

    @app.get("/healthz")
    async def alive() -> dict[str, str]:
        return {"status": "ok"}

    @app.post("/act")
    async def act(request: Request) -> Response:
        payload = json_numpy.loads(await request.body())
        assert payload["image"].shape == (480, 640, 3)
        return Response(json_numpy.dumps(ACTION), media_type="application/json")

    return app


def pack_array(value: object) -> object:
    """As openpi's `msgpack_numpy.pack_array`."""
    if isinstance(value, np.ndarray):
        fields = {b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
        return {b"__ndarray__": True, **fields}
    return value


def unpack_array(value: dict[Any, Any]) -> object:
    """As openpi's `msgpack_numpy.unpack_array`."""
    if b"__ndarray__" in value:
        return np.ndarray(buffer=value[b"data"], dtype=np.dtype(value[b"dtype"]), shape=value[b"shape"])
    return value


async def openpi_server(port: int) -> None:
    """Answer observations until cancelled."""

    async def infer(connection: ServerConnection) -> None:
        async for message in connection:
            observation = msgpack.unpackb(message, object_hook=unpack_array)
            assert observation["image"].shape == (480, 640, 3)
            await connection.send(msgpack.packb({"actions": ACTION}, default=pack_array))

    def health(connection: ServerConnection, request: Handshake) -> HandshakeAnswer | None:
        return connection.respond(http.HTTPStatus.OK, "OK\n") if request.path == "/healthz" else None

    async with serve(infer, "127.0.0.1", port, compression=None, max_size=None, process_request=health) as server:
        await server.serve_forever()


def main() -> None:
    """Serve as the peer that the command line names."""
    parser = argparse.ArgumentParser()
    parser.add_argument("peer", choices=["openvla", "openpi"])
    parser.add_argument("--port", type=int, required=True)
    arguments = parser.parse_args()
    if arguments.peer == "openvla":
        uvicorn.run(openvla_app(), port=arguments.port, log_level="warning")
    else:
        asyncio.run(openpi_server(arguments.port))


if __name__ == "__main__":
    main()
