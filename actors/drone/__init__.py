"""The drone's actor: vehicle, mission and setpoint loop; and its trajectory scheduler's."""
