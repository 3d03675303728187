"""Import and containment of plug-ins."""
