"""Track management: initiation, deletion, re-acquisition."""
