"""Limits of what a server of the API accepts: connections, bodies, rates and live views."""

from __future__ import annotations

import ipaddress
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from aerodaas.analytics.here.relay import LARGEST_ANSWER
from aerodaas.protocol.schemas import Role
from aerodaas.service.errors import RefusedError

__all__ = [
    "AGENTS_PATH",
    "LEASED_FLIGHT",
    "OWN_FLIGHT",
    "PROVIDER",
    "RateLimiter",
    "RequestLimits",
    "WrongTokens",
]

AGENTS_PATH = "/mcp"
"""Path at which agents come by their own protocol."""


@dataclass(frozen=True)
class RequestLimits:
    """Limits of one server; the gate and the server's connections apply them.

    An account is the holder of a token. Accounts of the role `reserved` and above are never refused
    for the number of their requests: such a request may call a drone home. Class variables are the
    same at every server.
    """

    connections: int = 1000
    """Connections at a time, of all addresses together."""
    message_bytes: int = LARGEST_ANSWER + (64 << 10)
    """Bytes of a WebSocket message: the answer of an analysis at the user's side, and its head."""
    ping_seconds: float | None = 5.0
    """Seconds after which a WebSocket that does not answer is closed; None for never."""
    reserved: Role = Role.OPERATOR
    """Lowest role that is never refused for its number of requests and live views."""
    rate: float = 50.0
    """Requests a second of one account, on average."""
    burst: float = 200.0
    """Requests of one account at once, after a pause."""
    account_views: int = 32
    """Live views and other WebSockets of one account."""

    head_seconds: ClassVar[float] = 10.0
    """From the connection, or the first byte of a further request, to the end of its headers."""
    body_seconds: ClassVar[float] = 300.0
    """For a body: 64 MiB, the largest model, by 2 Mbit/s."""
    answer_seconds: ClassVar[float] = 30.0
    """Within which a client takes `answer_bytes` of the bytes that wait for it, or all of them."""
    answer_bytes: ClassVar[int] = 30_000
    message_seconds: ClassVar[float] = 30.0
    """From the first byte of a WebSocket's message to its last."""
    unfinished_bytes: ClassVar[int] = 64 << 20
    """Of all WebSocket messages that are not whole yet; the oldest one is given up first."""
    fragments: ClassVar[int] = 64
    """Fragments of a message that are kept apart: one of a byte takes forty times its size."""

    rated_accounts: ClassVar[int] = 10_000
    """Accounts whose rate is remembered."""
    account_requests: ClassVar[int] = 16
    """Requests of one account at a time: further ones would keep others' commands waiting."""
    account_large_requests: ClassVar[int] = 2
    """Requests of one account at a time with a body of more than `large_bytes`."""
    account_agents: ClassVar[int] = 64
    """Calls of one agent at a time, which mostly wait; what each asks is a request of its own."""
    agents: ClassVar[int] = 256
    """The same of all agents."""
    requests: ClassVar[int] = 160
    """Requests at a time of all accounts below `reserved`, for which threads are left."""
    large_requests: ClassVar[int] = 16
    """Requests with a large body at a time of all accounts below `reserved`."""
    threads: ClassVar[int] = 200
    """Threads that answer requests: more than all accounts below `reserved` may keep busy."""
    address_views: ClassVar[int] = 160
    """Live views of one address."""
    views: ClassVar[int] = 320
    """Live views of all accounts below `reserved`."""
    view_streams: ClassVar[int] = 16
    """Streams of one live view."""
    view_rate: ClassVar[float] = 20.0
    """Messages of a mission's state a second of one live view."""

    submission_bytes: ClassVar[int] = 4 << 20
    """Bytes of a submission: a document of 10,000 waypoints has 2 MB."""
    command_bytes: ClassVar[int] = 1 << 20
    """Bytes of a command to a mission: one of 1,000 waypoints has a quarter."""
    model_bytes: ClassVar[int] = 64 << 20
    """Bytes of a model."""
    other_bytes: ClassVar[int] = 16 << 10
    """Bytes of any other body."""
    large_bytes: ClassVar[int] = 64 << 10
    """Bytes of a body of which an account sends few at a time."""
    body_values: ClassVar[int] = 300_000
    """Commas of a JSON body: 10,000 waypoints have 210,000."""
    body_groups: ClassVar[int] = 100_000
    """Opening brackets of a JSON body: 10,000 waypoints have 30,000."""
    few_values: ClassVar[int] = 20_000
    """Commas up to which `group_values` is not asked."""
    group_values: ClassVar[int] = 200
    """Values of a list or object on average: a waypoint has 26."""
    object_keys: ClassVar[int] = 1000
    """Keys of one object: unknown ones are refused one by one, which takes long."""
    body_errors: ClassVar[int] = 100
    """Errors of a body that are worded: each takes as long as many values."""

    wrong_tokens: ClassVar[int] = 10
    """Wrong tokens of one address in `wrong_token_seconds` that are answered without a pause."""
    wrong_tokens_of_all: ClassVar[int] = 100
    """The same of all addresses; people are alerted beyond it."""
    wrong_tokens_alerted: ClassVar[int] = 20
    """Wrong tokens of one address of which people are alerted."""
    wrong_token_seconds: ClassVar[float] = 60.0
    """Seconds after which the count begins anew."""
    wrong_token_addresses: ClassVar[int] = 1024
    """Addresses whose count is remembered."""

    def body_bytes(self, path: str) -> int:
        """Bytes that the body of a request for `path` may have."""
        if path in {"/v1/missions", "/v1/proposals", AGENTS_PATH}:
            return self.submission_bytes
        if path.startswith("/v1/missions/"):
            return self.command_bytes
        return self.model_bytes if path.startswith("/v1/models/") else self.other_bytes

    def at_a_time(
        self, kind: str, account: str, address: str, *, large: bool
    ) -> dict[tuple[str, str], int]:
        """Limits of one request below `reserved`, by what it counts as and by whose it is.

        Args:
            kind: `http`, `websocket`, or `agents` for a call at `AGENTS_PATH`.
            account: Account that sends the request.
            address: Address that it comes from.
            large: Whether its body has more than `large_bytes`.

        Returns:
            Most requests at a time; "" stands for all accounts together.
        """
        if kind == "websocket":
            return {
                ("live views", account): self.account_views,
                ("live views", address): self.address_views,
                ("live views", ""): self.views,
            }
        if kind == "agents":
            return {("calls", account): self.account_agents, ("calls", ""): self.agents}
        limits = {("requests", account): self.account_requests, ("requests", ""): self.requests}
        if large:
            limits["large requests", account] = self.account_large_requests
            limits["large requests", ""] = self.large_requests
        return limits


PROVIDER = RequestLimits()
"""Limits of a provider's service."""
OWN_FLIGHT = RequestLimits(
    connections=640,  # a page has two that stay, and a few that come and go
    message_bytes=4096,  # watchers have nothing to say
    reserved=Role.PILOT,
    rate=500.0,  # many may share the one token of who watches
    burst=2000.0,
    account_views=320,
)
"""Limits of one's own flight, or of recordings, with a token for each role."""
LEASED_FLIGHT = RequestLimits(
    connections=256,
    ping_seconds=None,  # the service is on this machine
    rate=10_000.0,  # the service has counted its users' requests
    burst=10_000.0,
    # The service has the other connections to command and follow: who watches much keeps no
    # operator from calling a drone home.
    account_views=48,
)
"""Limits of a leased flight's process, whose accounts are roles and whose one client the service
is."""


class RateLimiter:
    """A token bucket for each account, of a bounded number; threads may share it.

    A request costs one token; a bucket holds `burst` and fills at `rate` a second. Of too many
    accounts the one that asked least lately is forgotten, which fills its bucket.
    """

    def __init__(self, limits: RequestLimits, clock: Callable[[], float] = time.monotonic) -> None:
        """Admit requests by `limits`; `clock` gives seconds."""
        self._limits = limits
        self._clock = clock
        self._lock = threading.Lock()
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()
        """Tokens, and when they were counted, by account."""

    def admit(self, account: str) -> None:
        """Count a request of an account.

        Raises:
            RefusedError: With status 429 and `retry_after`, if its bucket is empty.
        """
        rate, burst = self._limits.rate, self._limits.burst
        with self._lock:
            now = self._clock()
            level, filled = self._buckets.pop(account, (burst, now))
            level = min(burst, level + rate * max(0.0, now - filled))
            lacking = 1.0 - level
            self._buckets[account] = (level if lacking > 0 else level - 1.0, now)
            if len(self._buckets) > self._limits.rated_accounts:
                self._buckets.popitem(last=False)
        if lacking > 0:
            wait = lacking / rate
            raise RefusedError(
                429, f"too many requests: wait {math.ceil(wait)} s", retry_after=wait
            )


class WrongTokens:
    """Counts wrong tokens; the right one is never refused, for the drone has to obey its operator.

    So a stranger behind the operator's own address cannot lock the operator out. What keeps a
    token from being guessed is its length; the pause keeps guessing from costing the drone's
    computer much, and the alert has people look.
    """

    def __init__(
        self,
        alert: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        server: str = "remote control",
    ) -> None:
        """Count from now on.

        Args:
            alert: Alerts people, once for each address and period.
            clock: Gives seconds.
            server: Name of what the tokens open, for people.
        """
        self._server = server
        self._alert = alert
        self._clock = clock
        self._peers: OrderedDict[str, tuple[float, int]] = OrderedDict()
        self._overall = (clock(), 0)
        self._silent_until = 0.0

    def count(self, address: str) -> int:
        """Count a wrong token from `address`.

        Returns:
            Seconds that the address has to wait; 0 while there were few.
        """
        limits = RequestLimits
        period, of_all = limits.wrong_token_seconds, limits.wrong_tokens_of_all
        now, peer = self._clock(), _peer(address)
        began, count = _next_count(self._peers.pop(peer, (now, 0)), now)
        self._peers[peer] = (began, count)
        while len(self._peers) > limits.wrong_token_addresses:
            self._peers.popitem(last=False)
        since, overall = self._overall = _next_count(self._overall, now)
        if count == limits.wrong_tokens_alerted and now >= self._silent_until:
            self._alert(f"{self._server}: {count} wrong tokens from {peer}")
        elif overall == of_all and now >= self._silent_until:
            self._silent_until = now + period
            self._alert(f"{self._server}: {overall} wrong tokens from several addresses")
        if count > limits.wrong_tokens:
            return max(1, round(began + period - now))
        return max(1, round(since + period - now)) if overall > of_all else 0


def _next_count(count: tuple[float, int], now: float) -> tuple[float, int]:
    began, number = count
    return (now, 1) if now - began > RequestLimits.wrong_token_seconds else (began, number + 1)


def _peer(address: str) -> str:
    """One name for the addresses that one host may choose from: a /64 of IPv6."""
    try:
        host = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if host.version == 4:  # noqa: PLR2004 - IP's own number
        return str(host)
    return str(ipaddress.ip_network((host, 64), strict=False))
