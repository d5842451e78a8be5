"""What elevation files add to the core: formats of `terrain.files` in an environment file."""

from aerodaas.config.extensions import Extension

_GEOTIFF = "aerodaas.extensions.terrain.geotiff:geotiff_tile"

EXTENSION = Extension(
    name="terrain",
    summary="Elevation files: SRTM's .hgt, and GeoTIFF in EPSG:4326.",
    elevation_formats={
        ".hgt": "aerodaas.extensions.terrain.hgt:hgt_tile",
        ".tif": _GEOTIFF,
        ".tiff": _GEOTIFF,
    },
)
