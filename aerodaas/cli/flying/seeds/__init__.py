"""`aerodaas run --seeds`: one application with many seeds, side by side."""
