"""Settings of one service: its fleet, its folder, and the provider's policy."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from aerodaas.config.model import EnvironmentConfig
from aerodaas.service.access.oidc import OidcSettings

__all__ = ["ServiceSettings"]


@dataclass(frozen=True)
class ServiceSettings:
    """Settings of `aerodaas serve`."""

    fleet: Path
    """The provider's environment file."""
    config: EnvironmentConfig
    """Its content."""
    state: Path
    """Folder of the database, models, and flights."""
    rehearse: bool = True
    """Fly each mission in simulation first."""
    monitor: bool = True
    """Hold the connection to each drone between its missions."""
    approval: bool = False
    """An operator has to approve each mission after its rehearsal."""
    speed: Literal["max"] | float = 1.0
    """Of simulated drones, as `aerodaas run --speed`."""
    address: str | None = None
    """Ray cluster that flights join; None: each has one of its own on this machine."""
    oidc: OidcSettings | None = None
    """OpenID Connect issuer whose tokens are good, too."""
    rehearsal_seconds: float = 300.0
    """Most seconds of a processor that a rehearsal uses."""
    rehearsal_bytes: int = 2 << 30
    """Most memory of the same."""
    most_rehearsals: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))
    """Most rehearsals at once; all others wait for their tenant's turn."""
    most_attached: int = 0
    """Most missions that sense by the cameras of one flight; 0: cameras are not shared."""
    edge_slots: int | None = None
    """Analyses that flights with an analytics scheduler run at once on this machine's edge, all
    together, by their tenants' weights; None: each flight runs its own as it likes."""
    actuators: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Actuators that a tenant may move, as `robot/actuator`; none for all others."""
    hourly_rehearsals: int = 12
    """Most rehearsals of an agent's proposals within an hour."""
    most_flights: int = 16
    """Most flights at once."""
    most_open: int = 50
    """Most missions of one tenant that are not over."""
    agents: bool = False
    """Agents may come by their own protocol, too (`service("agents.endpoint")`)."""
    public: str | None = None
    """Address by which users reach the service through a proxy; None: where it listens."""

    @property
    def models(self) -> Path:
        """Folder of the models that users have brought."""
        return self.state / "models"

    @property
    def edge_turns(self) -> Path:
        """Socket at which flights take turns on the edge."""
        return self.state / "edge"

    @property
    def locks(self) -> Path:
        """Folder of the drones' locks."""
        return self.state / "locks"

    @property
    def missions(self) -> Path:
        """Folder of the flights."""
        return self.state / "m"
