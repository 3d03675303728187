"""Registration: errors of UAVs' poses, and what they mean for measurements and tracks."""
