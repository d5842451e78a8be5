"""The DJI Ryze Tello over its SDK 2.0 and 3.0 (UDP)."""
