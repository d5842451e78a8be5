"""Plans of ground stations: QGroundControl's, Mission Planner's, and areas from KML and GeoJSON."""
