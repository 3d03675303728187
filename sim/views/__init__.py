"""What people look at: renderings of missions and recordings."""
