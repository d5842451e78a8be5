"""The notebook's helpers, which a notebook imports: `from aerodaas.extensions import notebook`."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="notebook",
    summary="Streams and recordings as tables and pictures in a notebook.",
)
