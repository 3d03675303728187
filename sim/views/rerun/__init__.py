"""A recorded mission for the Rerun viewer."""
