"""The wire to a vehicle: transports, framing, the link's thread, signing, and finding a vehicle."""
