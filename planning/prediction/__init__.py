"""Beliefs, views and intents over a horizon."""
