"""Tracks against the truth: OSPA, GOSPA, CLEAR MOT, NEES."""
