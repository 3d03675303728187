"""Why a person was tracked or lost."""
