"""`aerodaas lab`: analytics schedulers compared in simulation."""
