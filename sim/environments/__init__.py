"""Missions as environments for learning: PettingZoo's with an agent a UAV, Gymnasium's with the team as one."""
