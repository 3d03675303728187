"""Track-to-track association and consensus fusion across the fleet."""
