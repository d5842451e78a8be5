"""AeroDaaS: program drones as a service."""
