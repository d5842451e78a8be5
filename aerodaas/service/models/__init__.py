"""Models that tenants upload."""
