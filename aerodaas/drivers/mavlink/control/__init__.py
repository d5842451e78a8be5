"""Control of a vehicle: take-off and its cancellation, setpoints, guidance, and the watchdog."""
