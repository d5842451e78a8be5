"""Messages as JSON and as records: types, schemas, and items of unknown classes."""
