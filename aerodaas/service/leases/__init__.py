"""Who flies which drone until when."""

from aerodaas.service.leases.book import LeaseBook, Shelf, lease_out
from aerodaas.service.leases.candidates import Candidate, Fleet

__all__ = ["Candidate", "Fleet", "LeaseBook", "Shelf", "lease_out"]
