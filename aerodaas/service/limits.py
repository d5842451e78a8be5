from dataclasses import dataclass
@dataclass(frozen=True)
class TenantLimits:
    max_height: float | None = None
    max_speed: float | None = None
def limited(config, robots, *, tenant, area):
    return config
