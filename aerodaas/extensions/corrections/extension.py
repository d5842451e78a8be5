"""What corrections add to the core: the driver mavlink's setting `corrections`."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="corrections",
    summary="RTCM 3 corrections of a base station, passed on to MAVLink vehicles for RTK.",
    services={"corrections.open": "aerodaas.extensions.corrections.corrections:Corrections"},
)
