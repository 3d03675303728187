"""Motion models and the filter of one target, missed detections included."""
