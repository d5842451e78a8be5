"""MAVLink's microservices: commands, parameters, missions and fences, events, status texts."""
