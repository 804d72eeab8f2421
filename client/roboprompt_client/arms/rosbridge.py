"""Topics of ROS over rosbridge's JSON protocol (v2.0)."""

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
    """The last message of a topic, and when it came; where it is stamped, when its stamp changed last."""

    message: Message
    seen_s: float


class Rosbridge:
    """A connection that remembers the last message of each topic.

    Args:
        address: such as ws://192.168.1.5:9090.

    Raises:
        MotionError: from every method, once the connection is lost or rosbridge has said that something is wrong.
    """

    def __init__(self, address: str) -> None:
        client = import_extra("websockets.sync.client", "websockets", "ros")
        self._open = ExitStack()
        try:
            self._socket = self._open.enter_context(client.connect(address, open_timeout=CONNECT_S, max_size=None))
        except Exception as error:  # of the system, of TLS, and websockets' own
            raise MotionError(f"rosbridge, connect {address}: {error or type(error).__name__}") from error
        self._lost = ""
        self._last: dict[str, News] = {}
        self._merge: dict[str, Merge] = {}
        self._news = threading.Condition()
        threading.Thread(target=self._listen, name="rosbridge", daemon=True).start()

    def advertise(self, topic: str, kind: str) -> None:
        """Say that messages of a type will be published."""
        self._send("advertise", topic, type=kind)

    def subscribe(self, topic: str, kind: str, merge: Merge | None = None) -> None:
        """Ask for a topic's messages, of which the last one counts.

        Args:
            merge: makes one of the last message and the next, for topics of several publishers.
        """
        if merge is not None:
            self._merge[topic] = merge
        self._send("subscribe", topic, type=kind)

    def publish(self, topic: str, message: Message) -> None:
        """Send a message; rosbridge fills in the time of a header without one."""
        self._send("publish", topic, msg=message)

    def last(self, topic: str) -> News | None:
        """None before the first one."""
        with self._news:
            self._require_connected()
            return self._last.get(topic)

    def wait_until(self, known: Callable[[], bool]) -> None:
        """At most some seconds, for messages to come."""
        with self._news:
            self._news.wait_for(lambda: bool(self._lost) or known(), CONNECT_S)
            self._require_connected()

    def close(self) -> None:
        """End the connection."""
        self._open.close()

    def _require_connected(self) -> None:
        if self._lost:
            raise MotionError(f"rosbridge: {self._lost}")

    def _send(self, op: str, topic: str, **members: Any) -> None:  # noqa: ANN401
        try:
            self._socket.send(json.dumps({"op": op, "topic": topic, **members}))
        except Exception as error:  # websockets' ConnectionClosed, and whatever the system says of its socket
            raise MotionError(f"rosbridge: the connection is lost: {error or type(error).__name__}") from error

    def _listen(self) -> None:
        """Take what comes until the connection ends; what is no message of the protocol is its end, too."""
        reason = "the connection was closed"
        try:
            for text in self._socket:
                document = json.loads(text)
                if document["op"] == "status" and document.get("level") == "error":
                    reason = f"it says: {document.get('msg')}"
                    break
                if document["op"] == "publish":
                    self._take(document["topic"], document["msg"])
        except Exception as error:  # what is no JSON or has another form, and websockets' own
            reason = f"the connection is lost: {error or type(error).__name__}"
        with self._news:
            self._lost = reason
            self._news.notify_all()

    def _take(self, topic: str, message: Message) -> None:
        """A stamp that is that of the message before is no news: what publishes it may be frozen."""
        with self._news:
            before = self._last.get(topic)
            stamp = (message.get("header") or {}).get("stamp")
            frozen = before is not None and stamp and any(stamp.values()) and stamp == before.message["header"]["stamp"]
            if before is not None and topic in self._merge:
                message = self._merge[topic](before.message, message)
            self._last[topic] = News(message, before.seen_s if before and frozen else time.monotonic())
            self._news.notify_all()
