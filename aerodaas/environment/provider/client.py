"""ProviderClient: a provider's service as Python methods, one for each of its routes."""

from __future__ import annotations

import contextlib
import hashlib
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote, urlencode

from pydantic import BaseModel, TypeAdapter, ValidationError

from aerodaas.environment.provider.address import ServiceAddress
from aerodaas.environment.provider.exchange import Method, ProviderConnection, pauses
from aerodaas.environment.provider.wire import LiveConnection, WireConnection
from aerodaas.errors import ConfigError, SourceError
from aerodaas.messages.health import HealthReport
from aerodaas.mission.commands import Answer
from aerodaas.protocol.piloting import ActuateIn, RearrangeIn
from aerodaas.protocol.proposals import (
    ApprovalIn,
    ChangeIn,
    CheckReport,
    ProposalIn,
    RefusedCallIn,
    RehearseIn,
)
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    AccountIn,
    AccountOut,
    AuditOut,
    CommandIn,
    FleetOut,
    GrantIn,
    LeaseIn,
    LeaseOut,
    MissionIn,
    MissionOut,
    NavigationIn,
    PictureForm,
    Role,
    Scope,
    TenantChange,
    TenantOut,
    TokenIn,
    TokenOut,
    UsageOut,
)

__all__ = ["LARGEST_MODEL", "ProviderClient"]

M = TypeVar("M")
LARGEST_MODEL = 64 << 20
"""Bytes of a model that a service takes."""
_ABSENT = frozenset({404})
_TRIAL_SECONDS = 180.0
"""For a model, which a service runs once before it keeps it."""
_RESEND_SECONDS = 30.0
"""Seconds for which a submission is sent again, as long as a service takes to be started anew."""


def _nothing(_done: int, _all: int | None) -> None:
    """Show no progress."""


class ProviderClient:
    """Client of a provider's service; safe in any thread.

    Each method raises ConfigError or MissionError with the service's own text where that refuses,
    SourceError where it does not answer.

    >>> client = ProviderClient("https://provider.example", token="…")  # doctest: +SKIP
    >>> [robot.id for robot in client.fleet().robots if robot.lease is None]  # doctest: +SKIP
    """

    def __init__(
        self,
        url: str,
        token: str | None = None,
        *,
        insecure: bool = False,
        timeout: float = 10.0,
    ) -> None:
        """Configure the client, which connects with its first request.

        Args:
            url: `https://host`, with a port and a path if the service has them; `http` to this
                machine only.
            token: Of the account.
            insecure: Allow `http` to other machines.
            timeout: Seconds to wait for each answer.

        Raises:
            ConfigError: For an address of another form.
        """
        self.address = ServiceAddress.parse(url, insecure=insecure)
        self._exchange = ProviderConnection(self.address, token, timeout)

    def me(self) -> AccountOut:
        """The account that the token belongs to."""
        return self._ask(AccountOut, "GET", "/v1/me")

    def fleet(self) -> FleetOut:
        """The drones, and the environment that applications are built against."""
        return self._ask(FleetOut, "GET", "/v1/fleet")

    def fleet_scenery(self) -> SceneryOut:
        """Ground below the fleet: what stands in a simulated world, or tiles of the Earth."""
        return self._ask(SceneryOut, "GET", "/v1/fleet/scenery")

    def preflight(self, robot: str) -> HealthReport:
        """A drone's health before take-off, as it was when it was looked at last."""
        return self._ask(HealthReport, "GET", f"/v1/robots/{_part(robot)}/preflight")

    def request_lease(self, wanted: LeaseIn) -> LeaseOut:
        """Request drones for a time; the lease is queued until they are free."""
        return self._ask(LeaseOut, "POST", "/v1/leases", wanted)

    def leases(self) -> list[LeaseOut]:
        """All leases that the account may see."""
        return self._ask(list[LeaseOut], "GET", "/v1/leases")

    def lease(self, lease: str) -> LeaseOut:
        """One lease."""
        return self._ask(LeaseOut, "GET", f"/v1/leases/{_part(lease)}")

    def extend_lease(self, lease: str, minutes: float) -> LeaseOut:
        """Extend a lease.

        Args:
            lease: Id of the lease.
            minutes: Minutes by which it ends later.
        """
        path = f"/v1/leases/{_part(lease)}/extend"
        return self._ask(LeaseOut, "POST", path, {"minutes": minutes})

    def end_lease(self, lease: str) -> LeaseOut:
        """Give a lease back, or revoke it as an operator; its drones come home."""
        return self._ask(LeaseOut, "DELETE", f"/v1/leases/{_part(lease)}")

    def has_model(self, sha256: str) -> bool:
        """Whether the service has the model with this hash."""
        path = f"/v1/models/{_part(sha256)}"
        status, _ = self._exchange.send("HEAD", path, allowed=_ABSENT)
        return status not in _ABSENT

    def put_model(self, content: bytes) -> str:
        """Bring a model, an ONNX file; returns its SHA-256. Raises ConfigError if too large."""
        if len(content) > LARGEST_MODEL:
            raise ConfigError(
                f"a model for a provider has at most {LARGEST_MODEL >> 20} MiB, not "
                f"{len(content) / (1 << 20):.0f}"
            )
        sha256 = hashlib.sha256(content).hexdigest()
        headers = {"Content-Type": "application/octet-stream"}
        path = f"/v1/models/{sha256}"
        self._exchange.send("PUT", path, content, headers, patience=_TRIAL_SECONDS)
        return sha256

    def submit(self, wanted: MissionIn, key: str | None = None) -> MissionOut:
        """Submit a mission, once: where the answer is lost it is sent again, with the same key.

        Args:
            wanted: The mission.
            key: Idempotency key, 1 to 255 printable ASCII characters without quotation marks and
                backslashes: for a caller that may have to repeat the call itself. None for a
                random one.

        Raises SourceError once the service has not answered for half a minute; then `missions`
        tells whether it has arrived.
        """
        headers = {"Idempotency-Key": f'"{key or uuid.uuid4()}"'}
        waiting, until = pauses(), time.monotonic() + _RESEND_SECONDS
        while time.monotonic() + (pause := next(waiting)) < until:
            with contextlib.suppress(SourceError):
                return self._ask(MissionOut, "POST", "/v1/missions", wanted, headers)
            time.sleep(pause)
        return self._ask(MissionOut, "POST", "/v1/missions", wanted, headers)

    def missions(self) -> list[MissionOut]:
        """All missions that the account may see, newest first."""
        return self._ask(list[MissionOut], "GET", "/v1/missions")

    def mission(self, mission: str) -> MissionOut:
        """One mission with its newest state."""
        return self._ask(MissionOut, "GET", f"/v1/missions/{_part(mission)}")

    def cancel(self, mission: str) -> MissionOut:
        """Cancel a mission; drones in flight come home."""
        return self._ask(MissionOut, "DELETE", f"/v1/missions/{_part(mission)}")

    def grant(self, mission: str, tenant: str, sensors: Sequence[str] = ()) -> MissionOut:
        """Let a tenant attach missions to a mission's cameras.

        Args:
            mission: Id of the mission.
            tenant: Name of the tenant.
            sensors: Cameras by full id; none for all of the mission's.
        """
        path = f"/v1/missions/{_part(mission)}/grants/{_part(tenant)}"
        return self._ask(MissionOut, "PUT", path, GrantIn(sensors=list(sensors)))

    def withdraw(self, mission: str, tenant: str) -> MissionOut:
        """Withdraw what a tenant was granted; what it has attached ends.

        Args:
            mission: Id of the mission.
            tenant: Name of the tenant.
        """
        path = f"/v1/missions/{_part(mission)}/grants/{_part(tenant)}"
        return self._ask(MissionOut, "DELETE", path)

    def approve(self, mission: str, approval: ApprovalIn | None = None) -> MissionOut:
        """Approve a mission that waits for it, as an operator.

        Args:
            mission: Id of the mission.
            approval: What exactly is approved, of a proposal; None for a submitted mission.
        """
        return self._ask(MissionOut, "POST", f"/v1/missions/{_part(mission)}/approve", approval)

    def propose(self, proposal: ProposalIn) -> MissionOut:
        """Propose a mission, which nothing flies by; the same one again is the same proposal."""
        return self._ask(MissionOut, "POST", "/v1/proposals", proposal)

    def check(self, mission: str) -> CheckReport:
        """Check a proposal without flying, from its drones' present charge."""
        return self._ask(CheckReport, "GET", f"/v1/proposals/{_part(mission)}/check")

    def rehearse(self, mission: str, seeds: int = 3) -> MissionOut:
        """Have a proposal flown in simulation.

        Args:
            mission: Id of the proposal.
            seeds: Flights, each with another seed of gusts and noise, 1 to 5.
        """
        path = f"/v1/proposals/{_part(mission)}/rehearse"
        return self._ask(MissionOut, "POST", path, RehearseIn(seeds=seeds))

    def request_approval(self, mission: str) -> MissionOut:
        """Ask for the approval of a proposal whose newest rehearsal was good."""
        return self._ask(MissionOut, "POST", f"/v1/proposals/{_part(mission)}/request")

    def change(self, mission: str, change: ChangeIn) -> MissionOut:
        """Propose other waypoints for a robot in flight; the answer is a proposal of its own.

        Args:
            mission: Id of the mission, which flies.
            change: The robot and its new waypoints.
        """
        return self._ask(MissionOut, "POST", f"/v1/missions/{_part(mission)}/changes", change)

    def report_refused_call(self, tool: str, text: str) -> None:
        """Have a call written into the audit log that an agent's tool has refused by its form.

        Args:
            tool: Name of the tool.
            text: The refusal.
        """
        content = RefusedCallIn(tool=tool, text=text).model_dump_json().encode()
        headers = {"Content-Type": "application/json"}
        self._exchange.send("POST", "/v1/refused-calls", content, headers)

    def command(self, mission: str, command: CommandIn) -> Answer:
        """Give a robot of a flying mission a command.

        Args:
            mission: Id of the mission.
            command: The robot and the command's word.

        Returns:
            The robot's own answer.
        """
        path = f"/v1/missions/{_part(mission)}/commands"
        return self._ask(Answer, "POST", path, command)

    def add_navigation(self, mission: str, navigation: NavigationIn) -> Answer:
        """Add waypoints to the queue of a robot, or replace the queue.

        Args:
            mission: Id of the mission, which flies.
            navigation: The robot, its waypoints and their place in the queue.

        Returns:
            The robot's own answer.
        """
        path = f"/v1/missions/{_part(mission)}/navigation"
        return self._ask(Answer, "POST", path, navigation)

    def rearrange(self, mission: str, change: RearrangeIn) -> Answer:
        """Change the order of a robot's coming waypoints, or remove some, as a whole.

        Args:
            mission: Id of the mission, which flies.
            change: The robot, the waypoints that change places, and those that are removed.

        Returns:
            The robot's own answer.
        """
        return self._ask(Answer, "POST", f"/v1/missions/{_part(mission)}/plan", change)

    def actuate(self, mission: str, wanted: ActuateIn) -> Answer:
        """Move an actuator of a robot.

        Args:
            mission: Id of the mission, which flies.
            wanted: The robot, the actuator and its new position.

        Returns:
            The robot's own answer.
        """
        return self._ask(Answer, "POST", f"/v1/missions/{_part(mission)}/actuators", wanted)

    def recording(
        self,
        mission: str,
        target: Path,
        progress: Callable[[int, int | None], None] = _nothing,
    ) -> None:
        """Fetch the recording of a mission that is over into the file `target`.

        Args:
            mission: Id of the mission.
            target: The file, which is replaced.
            progress: Called with the bytes that are there, and all of them if that is known.

        Raises:
            OSError: If the file cannot be written.
        """
        self._exchange.download(f"/v1/missions/{_part(mission)}/recording", target, progress)

    def delete_recording(self, mission: str) -> None:
        """Remove the recording of a mission that is over from the provider."""
        self._exchange.send("DELETE", f"/v1/missions/{_part(mission)}/recording")

    def rehearsal_picture(self, mission: str, target: Path) -> None:
        """Fetch the picture of a rehearsed flight, a PNG.

        Args:
            mission: Id of the mission.
            target: The file, which is replaced.

        Raises:
            OSError: If the file cannot be written.
        """
        path = f"/v1/missions/{_part(mission)}/rehearsal.png"
        self._exchange.download(path, target, _nothing)

    def live(
        self,
        mission: str,
        rate: float = 5.0,
        *streams: str,
        pictures: PictureForm = PictureForm.WHOLE,
    ) -> LiveConnection:
        """Connect to a mission's state and to items of its streams.

        Args:
            mission: Id of the mission.
            rate: States per second at most.
            *streams: Names of the streams whose items are sent.
            pictures: Form in which pictures are sent.

        Raises:
            SourceError: If there is no connection.
            AeroDaaSError: What `mission` raises.
        """
        query = urlencode(
            {"rate": f"{rate:g}", "streams": ",".join(streams), "pictures": pictures.value}
        )
        path = f"/v1/missions/{_part(mission)}/live?{query}"
        return LiveConnection.open(self._exchange, path)

    def here(self, mission: str) -> WireConnection:
        """Connect as the user's side of a mission, which is asked by its own analyses.

        Raises as `live`.
        """
        path = f"/v1/missions/{_part(mission)}/here"
        return WireConnection.open(self._exchange, path)

    def accounts(self) -> list[AccountOut]:
        """All accounts, as an administrator."""
        return self._ask(list[AccountOut], "GET", "/v1/accounts")

    def add_account(self, account: AccountIn) -> AccountOut:
        """Make an account, as an administrator."""
        return self._ask(AccountOut, "POST", "/v1/accounts", account)

    def change_account(
        self,
        name: str,
        *,
        role: Role | None = None,
        scopes: list[Scope] | None = None,
        disabled: bool | None = None,
    ) -> AccountOut:
        """Change an account, as an administrator.

        Args:
            name: Name of the account.
            role: New role; None keeps it.
            scopes: New scopes; None keeps them.
            disabled: Whether the account is disabled; None keeps it.
        """
        content = {"role": role, "scopes": scopes, "disabled": disabled}
        return self._ask(AccountOut, "PATCH", f"/v1/accounts/{_part(name)}", content)

    def tenants(self) -> list[TenantOut]:
        """One's own tenant with what it may use, or all as an administrator."""
        return self._ask(list[TenantOut], "GET", "/v1/tenants")

    def change_tenant(self, name: str, change: TenantChange) -> TenantOut:
        """Change what a tenant may use, as an administrator.

        Args:
            name: Name of the tenant.
            change: New limits; a field that is not set stays as it is.
        """
        content = change.model_dump(mode="json", exclude_unset=True)
        return self._ask(TenantOut, "PATCH", f"/v1/tenants/{_part(name)}", content)

    def tokens(self) -> list[TokenOut]:
        """One's own tokens, or all as an administrator; without their secrets."""
        return self._ask(list[TokenOut], "GET", "/v1/tokens")

    def issue_token(self, wanted: TokenIn) -> TokenOut:
        """Make a token, as an administrator; only this answer has its secret."""
        return self._ask(TokenOut, "POST", "/v1/tokens", wanted)

    def revoke_token(self, token: str) -> TokenOut:
        """Revoke a token, as an administrator."""
        return self._ask(TokenOut, "DELETE", f"/v1/tokens/{_part(token)}")

    def audit(self, limit: int = 100) -> list[AuditOut]:
        """The newest entries of the audit log, as an administrator."""
        return self._ask(list[AuditOut], "GET", f"/v1/audit?limit={limit:d}")

    def usage(self) -> list[UsageOut]:
        """Usage of missions: the tenant's own, or all as an operator."""
        return self._ask(list[UsageOut], "GET", "/v1/usage")

    def _ask(
        self,
        kind: type[M],
        method: Method,
        path: str,
        content: BaseModel | dict[str, Any] | None = None,
        headers: dict[str, str] | None = None,
    ) -> M:
        body = content.model_dump(mode="json") if isinstance(content, BaseModel) else content
        answer = self._exchange.ask(method, path, body, headers)
        try:
            return TypeAdapter(kind).validate_python(answer, extra="ignore")
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"]))
            raise self._exchange.strange(f"{path}: {place}: {first['msg']}") from None


def _part(name: str) -> str:
    """A name as one part of a path."""
    return quote(name, safe="")
