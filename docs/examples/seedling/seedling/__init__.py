"""A planner whose policy was learned in Understory's missions, and the script that trains it."""
