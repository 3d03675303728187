"""Missions as environments for learning: in PettingZoo each UAV is an agent, in Gymnasium the team is one agent."""
