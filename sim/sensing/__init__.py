"""From the world to scans: cameras, detectors, false alarms."""
