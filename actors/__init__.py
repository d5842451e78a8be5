"""Actors of a flight: the only code that imports Ray."""

from aerodaas.actors.cluster.ray_variables import set_variables

# Ray reads its variables once, as it is imported, and code of this package imports it.
set_variables()
