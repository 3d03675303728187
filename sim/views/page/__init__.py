"""The page of a mission, `mission.html`."""
