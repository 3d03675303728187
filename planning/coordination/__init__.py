"""Coordination of a team: sequential, parallel, decentralised and centralised planning."""
