"""Missions looked at again, from their recordings alone."""
