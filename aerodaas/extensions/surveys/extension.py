"""What surveys add to the core: a route of a service, for areas that are drawn on its map."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="surveys",
    summary="Surveys that photograph an area for a map.",
    requires=("payload",),
    routes=("aerodaas.extensions.surveys.service:survey_router",),
)
