"""Control of a vehicle: take-off and its withdrawal, setpoints, guidance, and the watchdog."""
