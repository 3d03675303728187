"""Staged views, frames and scans, which conformance checks and warm-up share."""
