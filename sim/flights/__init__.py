"""Flights from elsewhere: their files, and the trackers on them."""
