"""ROS topics over rosbridge's JSON protocol (v2.0)."""

import json
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, NamedTuple

from roboprompt_client.errors import MotionError
from roboprompt_client.extras import import_extra

CONNECT_S = 10.0
Message = Mapping[str, Any]
Merge = Callable[[Message, Message], Message]


class News(NamedTuple):
    """A topic's last message, and when it arrived, or when its time stamp last changed."""

    message: Message
    seen_s: float


class Rosbridge:
    """A connection that remembers the last message of each topic.

    Args:
        address: such as ws://192.168.1.5:9090.

    Raises:
        MotionError: from every method, after the connection is lost or rosbridge has reported an error.
    """

    def __init__(self, address: str) -> None:
        client = import_extra("websockets.sync.client", "websockets", "ros")
        self._open = ExitStack()
        try:
            self._socket = self._open.enter_context(client.connect(address, open_timeout=CONNECT_S, max_size=None))
        except Exception as error:  # of the system, of TLS, or of websockets
            remedy = "does rosbridge_server run there, and is the address like ws://192.168.1.5:9090?"
            raise MotionError(f"rosbridge, connect {address}: {error or type(error).__name__}: {remedy}") from error
        self._lost = ""
        self._last: dict[str, News] = {}
        self._merge: dict[str, Merge] = {}
        self._news = threading.Condition()
        threading.Thread(target=self._listen, name="rosbridge", daemon=True).start()

    def advertise(self, topic: str, kind: str) -> None:
        """Announce messages of a type on a topic."""
        self._send("advertise", topic, type=kind)

    def subscribe(self, topic: str, kind: str, merge: Merge | None = None) -> None:
        """Subscribe to a topic, whose last message is kept.

        Args:
            merge: combines the last message with the next, for topics with several publishers.
        """
        if merge is not None:
            self._merge[topic] = merge
        self._send("subscribe", topic, type=kind)

    def publish(self, topic: str, message: Message) -> None:
        """Publish a message; rosbridge fills in a missing time stamp."""
        self._send("publish", topic, msg=message)

    def last(self, topic: str) -> News | None:
        """Return the topic's last message; None before the first one."""
        with self._news:
            self._require_connected()
            return self._last.get(topic)

    def wait_until(self, known: Callable[[], bool]) -> None:
        """Wait until `known()` is true, at most `CONNECT_S`; it is called after each message."""
        with self._news:
            self._news.wait_for(lambda: bool(self._lost) or known(), CONNECT_S)
            self._require_connected()

    def close(self) -> None:
        """Close the connection."""
        self._open.close()

    def _require_connected(self) -> None:
        if self._lost:
            raise MotionError(f"rosbridge: {self._lost}")

    def _send(self, op: str, topic: str, **members: Any) -> None:  # noqa: ANN401
        try:
            self._socket.send(json.dumps({"op": op, "topic": topic, **members}))
        except Exception as error:  # websockets' ConnectionClosed, or an error of the system's socket
            raise MotionError(f"rosbridge: the connection is lost: {error or type(error).__name__}") from error

    def _listen(self) -> None:
        """Keep messages until the connection ends; a malformed message ends it, too."""
        reason = "the connection was closed"
        try:
            for text in self._socket:
                document = json.loads(text)
                if document["op"] == "status" and document.get("level") == "error":
                    reason = f"it says: {document.get('msg')}"
                    break
                if document["op"] == "publish":
                    self._take(document["topic"], document["msg"])
        except Exception as error:  # malformed messages, and websockets' own errors
            reason = f"the connection is lost: {error or type(error).__name__}"
        with self._news:
            self._lost = reason
            self._news.notify_all()

    def _take(self, topic: str, message: Message) -> None:
        """Keep a message; one with the same time stamp as before is not new, because its publisher may be frozen."""
        with self._news:
            before = self._last.get(topic)
            stamp = (message.get("header") or {}).get("stamp")
            frozen = before is not None and stamp and any(stamp.values()) and stamp == before.message["header"]["stamp"]
            if before is not None and topic in self._merge:
                message = self._merge[topic](before.message, message)
            self._last[topic] = News(message, before.seen_s if before and frozen else time.monotonic())
            self._news.notify_all()
