"""Commands that fly an application, and those that try or draw what would fly."""
