"""Who flies which drone until when."""

from aerodaas.service.leases.book import LeaseBook, Shelf
from aerodaas.service.leases.candidates import Candidate, Fleet
from aerodaas.service.leases.wish import lease_out

__all__ = ["Candidate", "Fleet", "LeaseBook", "Shelf", "lease_out"]
