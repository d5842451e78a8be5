"""Start-time fair queueing of one server: the start tag with the least virtual time is next.

Goyal, Vin, Cheng, "Start-time fair queueing: a scheduling algorithm for integrated services packet
switching networks", SIGCOMM 1996. For a server that runs several at once, the same tags are used as
in SFQ(D): Jin, Chase, Kaur, "Interposed proportional sharing for a storage service utility",
SIGMETRICS 2004.
"""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["FairQueue"]


@dataclass
class FairQueue:
    """Tags of one server's tenants."""

    now: float = 0.0
    """Virtual time: start tag of the newest execution, nanoseconds over weight."""
    finish: dict[str, float] = field(default_factory=dict)
    """Finish tag of each tenant's newest execution."""

    def tag(self, tenant: str) -> float:
        """Start tag of the tenant's next execution."""
        return max(self.now, self.finish.get(tenant, 0.0))

    def serve(self, tenant: str, taken: float) -> None:
        """An execution of a tenant has started.

        Args:
            tenant: Name of the tenant.
            taken: Time that it takes over the tenant's weight, nanoseconds.
        """
        self.now = self.tag(tenant)
        self.finish[tenant] = self.now + taken

    def correct(self, tenant: str, by: float) -> None:
        """An execution has taken another time than was told at its start.

        Args:
            tenant: Name of the tenant.
            by: Time that it took in addition over the tenant's weight, nanoseconds.
        """
        self.finish[tenant] += by
