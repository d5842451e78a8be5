"""The state of a vehicle: telemetry, frames of reference, health, flight phase, touchdown."""
