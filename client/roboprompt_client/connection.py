"""Which addresses are this machine's own."""

import ipaddress
from urllib.parse import urlsplit


def is_loopback(host: str) -> bool:
    """Whether a host, by name or address, is this machine and nobody else can reach it."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def is_own_machine(url: str) -> bool:
    """Whether a URL names this machine: no proxy is for that, nor may one see what is sent there."""
    try:
        return is_loopback(urlsplit(url).hostname or "")
    except ValueError:
        return False


def without_proxy(url: str) -> dict[str, None] | None:
    """What httpx's `mounts` say so that proxies of the environment are not used for this machine; None for others.

    Certificates that the environment names are used all the same, which `trust_env=False` would not do.
    """
    return {"http://": None, "https://": None} if is_own_machine(url) else None
